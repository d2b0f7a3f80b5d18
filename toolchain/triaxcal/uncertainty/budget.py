"""Budgets: each source's share of one quantity, worst first, combined as GUM 5.1.2 and annex G."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.uncertainty.coverage import coverage_factor, effective_dof, with_offset
from triaxcal.uncertainty.source import Source


@dataclass(frozen=True)
class Line:
    """One source in the budget of one quantity.

    Attributes
    ----------
    source : Source
    contribution : float or None
        Standard uncertainty that it gives the quantity, in the quantity's unit; None when it is
        unknown.
    share : float
        Of the combined variance, 0 to 1.
    """

    source: Source
    contribution: float | None
    share: float = 0.0

    @property
    def sensitivity(self) -> float | None:
        """`contribution` / size of the source: quantity's unit per source's unit."""
        sd = self.source.sd
        return self.contribution / sd if sd and self.contribution is not None else None


@dataclass(frozen=True, repr=False)
class Budget:
    """Uncertainty of one quantity.

    Attributes
    ----------
    lines : tuple of Line
        Unknown sources first, then the worst first.
    combined : float
        Combined standard uncertainty of what is known.
    dof : float
        Effective degrees of freedom.
    factor : float
        k of the 95 % interval.
    """

    quantity: str
    unit: str
    lines: tuple[Line, ...]
    combined: float
    dof: float
    factor: float

    def __str__(self) -> str:
        head = f"{self.quantity}: +-{self.expanded:.3g} {self.unit} (95 %, k = {self.factor:.2f})"
        rows = [
            [
                "  " + line.source.key.replace("_", " "),
                "unknown" if line.source.sd is None else f"{line.source.sd:.3g}",
                line.source.unit.replace("°C", "degC").replace("²", "^2"),
                "unknown" if line.contribution is None else f"{line.contribution:.3g}",
                "?" if line.contribution is None else f"{100 * line.share:.1f} %",
            ]
            for line in self.lines
        ]
        names = ["  source", "size", "unit", f"gives, {self.unit}", "share"]
        return "\n".join([head, *table(names, rows)])

    __repr__ = __str__

    @property
    def expanded(self) -> float:
        """Half-width of the 95 % interval."""
        return self.factor * self.combined

    @property
    def unknown(self) -> tuple[Line, ...]:
        """Sources of which nothing is known."""
        return tuple(line for line in self.lines if line.contribution is None)

    @property
    def worst(self) -> Line | None:
        """The source that contributes most; None where nothing that is known contributes."""
        return next((line for line in self.lines if line.contribution), None)

    @property
    def verdict(self) -> str:
        """What to improve, in a sentence."""
        text = "Nothing that is known contributes."
        if self.worst is not None:
            source, share = self.worst.source, 100 * self.worst.share
            text = (
                f"{source.name[0].upper()}{source.name[1:]} gives {share:.0f} % of the "
                f"uncertainty of {self.quantity}; to improve it, {source.advice}."
            )
        for line in self.unknown:
            text += f" Not in it: {line.source.name}, which is unknown; {line.source.advice}."
        return text


def budget(quantity: str, unit: str, sources: Sequence[tuple[Source, float | None]]) -> Budget:
    """Combine sources whose contributions stand beside them; None is unknown."""
    known = [(source, u) for source, u in sources if u is not None]
    variance = math.fsum(u * u for _, u in known)
    combined = math.sqrt(variance)
    dof = effective_dof((u, source.dof) for source, u in known if not source.offset)
    factor = coverage_factor(dof)
    offset = math.fsum(u * u for source, u in known if source.offset)
    if offset:
        half_width = factor * math.sqrt(max(variance - offset, 0.0))
        expanded = with_offset(np.array(half_width), np.array(math.sqrt(offset)))
        factor = float(expanded) / combined
    lines = [
        Line(source, u, u * u / variance if variance else 0.0)
        for source, u in sorted(known, key=lambda item: -item[1])
    ]
    unknown = [Line(source, None) for source, u in sources if u is None]
    return Budget(quantity, unit, (*unknown, *lines), combined, dof, factor)
