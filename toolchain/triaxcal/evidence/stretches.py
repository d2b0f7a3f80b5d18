"""Which rests and turns of a recording are held out.

A stretch is a turn, the rest after it, and the next turn: from the end of one rest to the start of
the next but one. Every `EVERY`-th rest is the middle of one. The choice looks at no measured value
but where the unit rests, so that it cannot favour a result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from triaxcal.dynamic.rests import runs_of
from triaxcal.dynamic.survey import Survey
from triaxcal.model.types import BoolArray, FloatArray

EVERY = 5
"""A stretch holds two turns: two fifths of the turns and a fifth of the rests are held out."""
REST_MIN_S = 0.8
"""A shorter rest gives no direction: the unit may still swing."""


@dataclass(frozen=True)
class Rest:
    """Consecutive windows at rest: from `start_s` to `end_s`."""

    start_s: float
    end_s: float

    def holds(self, time_s: FloatArray) -> BoolArray:
        """Whether times lie in it."""
        return (time_s >= self.start_s) & (time_s <= self.end_s)


@dataclass(frozen=True)
class Stretch:
    """Three rests that follow each other; the middle one and both turns are held out."""

    before: Rest
    middle: Rest
    after: Rest

    @property
    def rests(self) -> tuple[Rest, Rest, Rest]:
        """In their order."""
        return self.before, self.middle, self.after


def rests_of(found: Survey) -> tuple[tuple[Rest, ...], ...]:
    """Rests of each section without a gap that last `REST_MIN_S`.

    Their rate is that of rest: where a hand begins to lift slowly, |a| is not g.
    """
    windows = found.windows
    sections: list[list[Rest]] = [[] for _ in found.sections]
    for a, b in runs_of(found.still & found.use & (windows.section >= 0), windows.section):
        end_s = float(windows.start_s[b - 1] + windows.duration_s[b - 1])
        rest = Rest(float(windows.start_s[a]), end_s)
        if rest.end_s - rest.start_s >= REST_MIN_S:
            sections[windows.section[a]].append(rest)
    return tuple(map(tuple, sections))


def at_rest(found: Survey) -> BoolArray:
    """Windows of the rests, shape (w,)."""
    return found.resting & found.use


def stretches_of(found: Survey, every: int = EVERY) -> tuple[Stretch, ...]:
    """Stretches about every `every`-th rest of a recording, counted through its sections."""
    chosen = []
    number = every // 2
    for rests in rests_of(found):
        for before, middle, after in zip(rests, rests[1:], rests[2:], strict=False):
            number += 1
            if number % every == 0:
                chosen.append(Stretch(before, middle, after))
    return tuple(chosen)


def without(found: Survey, stretches: tuple[Stretch, ...]) -> Survey:
    """The survey with nothing measured in the stretches."""
    start = found.windows.start_s
    end = start + found.windows.duration_s
    use = found.use.copy()
    for stretch in stretches:
        use &= ~((end > stretch.before.end_s) & (start < stretch.after.start_s))
    return replace(found, use=use)
