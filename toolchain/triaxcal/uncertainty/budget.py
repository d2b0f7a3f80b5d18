"""Budgets: each source's share of one quantity, worst first, combined as GUM 5.1.2 and annex G."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.uncertainty.coverage import coverage_factor, effective_dof


@dataclass(frozen=True)
class Line:
    """One source in the budget of one quantity.

    Attributes
    ----------
    sd : float or None
        Standard uncertainty of the source in `unit`; None when it is unknown.
    sensitivity : float or None
        `contribution` / `sd`: quantity's unit per source's unit.
    contribution : float or None
        Standard uncertainty that it gives the quantity, in the quantity's unit.
    share : float
        Of the combined variance, 0 to 1.
    """

    key: str
    name: str
    sd: float | None
    unit: str
    distribution: str
    dof: float
    sensitivity: float | None
    contribution: float | None
    share: float
    origin: str
    advice: str


@dataclass(frozen=True)
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

    @property
    def expanded(self) -> float:
        """Half-width of the 95 % interval."""
        return self.factor * self.combined

    @property
    def unknown(self) -> tuple[Line, ...]:
        """Sources of which nothing is known."""
        return tuple(line for line in self.lines if line.contribution is None)

    @property
    def verdict(self) -> str:
        """What to improve, in a sentence."""
        worst = next((line for line in self.lines if line.contribution), None)
        if worst is None:
            text = "Nothing that is known contributes."
        else:
            text = (
                f"{worst.name[0].upper()}{worst.name[1:]} gives {100 * worst.share:.0f} % of the "
                f"uncertainty of {self.quantity}; to improve it, {worst.advice}."
            )
        for line in self.unknown:
            text += f" Not in it: {line.name}, which is unknown; {line.advice}."
        return text


def budget(quantity: str, unit: str, sources: Sequence[tuple[Line, float | None]]) -> Budget:
    """Combine lines whose contributions stand beside them; None is unknown."""
    known = [(line, u) for line, u in sources if u is not None]
    variance = math.fsum(u * u for _, u in known)
    combined = math.sqrt(variance)
    dof = effective_dof((u, line.dof) for line, u in known)
    lines = [
        Line(
            line.key, line.name, line.sd, line.unit, line.distribution, line.dof,
            u / line.sd if line.sd else None, u, u * u / variance if variance else 0.0,
            line.origin, line.advice,
        )
        for line, u in sorted(known, key=lambda item: -item[1])
    ]  # fmt: skip
    unknown = [line for line, u in sources if u is None]
    return Budget(quantity, unit, (*unknown, *lines), combined, dof, coverage_factor(dof))
