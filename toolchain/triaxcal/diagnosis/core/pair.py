"""Two causes at once: one hypothesis of a cause that has been judged and a second one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.diagnosis.core.cause import DwellCause, Hypothesis, Size, either, name_of
from triaxcal.diagnosis.core.evidence import FAULT_LOG_ODDS, Judged
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray

_SIGNIFICANT = 3.0
"""Standard deviations from which an amplitude is one."""


@dataclass(frozen=True)
class Pair:
    """A cause that was judged, and what explains best what remains without it.

    Attributes
    ----------
    causes : tuple of two Cause
    first : Judged
    second : Hypothesis
        About the readings without the first.
    """

    causes: tuple[DwellCause, DwellCause]
    first: Judged
    second: Hypothesis

    @property
    def names(self) -> str:
        """Both, in words."""
        first, second = self._names
        return f"(1) {first}, and (2) {second}"

    @property
    def _names(self) -> list[str]:
        hypotheses = self.first.hypothesis, self.second
        return [name_of(c, h) for c, h in zip(self.causes, hypotheses, strict=True)]

    @property
    def possible(self) -> bool:
        """Whether they are two: an output is lost once."""
        one, other = self._names
        lost = self.first.hypothesis.unused, self.second.unused
        return one != other and any(unused is None for unused in lost)

    def superfluous(self, judged: Judged) -> bool:
        """Whether the first has no effect beside the second, `judged` being both."""
        count = len(self.first.hypothesis.parameters)
        own = np.abs(judged.amplitudes[:count]) < _SIGNIFICANT * judged.sd[:count]
        return count > 0 and bool(own.all())

    @property
    def key(self) -> str:
        """The same for both orders of two causes."""
        return " ".join(sorted(self._names))

    def hypothesis(self) -> Hypothesis:
        """Both as one: the second is undone after the first.

        It pays for both. The prior size of the first's amplitudes is the one that was found.
        """
        first, second = self.first.hypothesis, self.second
        rows = np.union1d(first.rows, second.rows)
        return Hypothesis(
            self.names,
            self._undo,
            first.parameters + second.parameters,
            rows if len(first.rows) and len(second.rows) else rows[:0],
            " and ".join(h.change for h in (first, second) if h.change != "nothing"),
            places=first.places * second.places * _ways(first),
            # What makes the second more probable than others has made the first so, too.
            log_prior=first.log_prior + min(second.log_prior, 0.0) + FAULT_LOG_ODDS,
            sizes=self._sizes(),
            noise=first.noise or second.noise,
            unused=either(first.unused, second.unused),
            log_density=first.log_density + second.log_density,
            spoils=any(c.spoils for c in self.causes),
            without_checks=first.without_checks or second.without_checks,
        )

    def _undo(self, readings: Readings, amplitudes: FloatArray) -> Readings:
        own = len(self.first.hypothesis.parameters)
        once = self.first.hypothesis.undo(readings, amplitudes[:own])
        return self.second.undo(once, amplitudes[own:])

    def _sizes(self) -> tuple[Size, ...]:
        of_first: Size = 0.0 if self.first.added is None else self.first.added.size
        head = np.full(len(self.first.hypothesis.parameters), of_first)
        count = len(self.second.parameters)
        sizes = self.second.sizes if count else self.second.sizes[:1]
        return tuple(np.concatenate([head, np.full(count, size)]) for size in sizes)


def _ways(first: Hypothesis) -> float:
    """Prior sizes and factors on the noise that the first has tried."""
    sizes = len(first.sizes) if first.parameters else 1
    return float(sizes * max(len(first.noise), 1))
