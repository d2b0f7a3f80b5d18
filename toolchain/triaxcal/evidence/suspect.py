"""A cause as if it were allowed for, and what tries it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from triaxcal.dynamic.again import extended, task_again
from triaxcal.dynamic.filterpass import run_pass
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.survey import Survey
from triaxcal.evidence.case import Case
from triaxcal.evidence.heldout import HeldOut, held_out_every
from triaxcal.model.types import IntArray


@dataclass(frozen=True)
class Suspect:
    """A cause as if it were allowed for.

    Attributes
    ----------
    words, remedy : str
    innovations : tuple of float and int
        Their chi-square and its degrees of freedom.
    held : HeldOut or None
        Held-out rests and turns.
    direct : bool
        Whether the recording shows the cause itself, and the trial leaves a part of it out or
        changes its noise: its chi-square is none of the same data.
    rival : bool
        Of a direct cause whose chi-square is of the same data all the same: an effect that is as
        likely, or more, is named in its place.
    """

    words: str
    remedy: str
    innovations: tuple[float, int]
    held: HeldOut | None
    direct: bool = False
    rival: bool = False


class Trial(Protocol):
    """One cause."""

    name: str

    def of(self, case: Case, held: HeldOut | None, /) -> Suspect | None:
        """The cause allowed for; None where the recording shows no sign of it."""


def again(words: str, remedy: str, case: Case, held: HeldOut | None) -> Suspect:
    """One more pass about the result, and one without the held-out part."""
    out = None if held is None else held_out_every(case, held.every)
    return Suspect(words, remedy, innovations_again(case), out)


def innovations_again(
    case: Case,
    found: Survey | None = None,
    cuts_s: tuple[float, ...] = (),
    renewed: IntArray | None = None,
    layout: Layout | None = None,
) -> tuple[float, int]:
    """Chi-square and degrees of freedom of one more pass about the result.

    `layout` may have further blocks after those of the result.
    """
    result = case.result
    layout = layout or result.layout
    task = task_again(case.recording, result, layout, case.noise)
    task = replace(task, survey=found or result.survey, cuts_s=cuts_s)
    if renewed is not None:
        task = replace(task, renewed=renewed)
    done = run_pass(task, extended(result, layout), first=False)
    return done.chi_square, done.freedom
