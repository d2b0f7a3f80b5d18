"""A part of the recording that the solution has not used, and how well it predicts it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.again import extended, task_again
from triaxcal.dynamic.blocks import north
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.filterpass import Progress, run_pass
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.passdata import Reference
from triaxcal.evidence.case import Case
from triaxcal.evidence.prediction import Predicted, StretchWatch
from triaxcal.evidence.stretches import EVERY, stretches_of, without
from triaxcal.model.types import FloatArray

SPARSER = (EVERY, 7, 11, 23)
"""Every so many rests; the first with which the rest of the recording still determines the
constants."""
KEPT_SD = 2.0
"""It does where no standard deviation of the base model grows by more than this factor. Others may:
an attitude that is forgotten costs the heading, and what only a heading shows turns no tilt."""
PASSES_MAX = 3
AGAIN_SD = 5.0
"""Constants that a part of the recording moves by chance move by less; its square is what one
linear pass leaves out."""


@dataclass(frozen=True)
class HeldOut:
    """The solution without the held-out part, and its predictions.

    Attributes
    ----------
    every : int
        Every so many rests are held out.
    layout : Layout
    step : array, shape (n,)
        Constants without the held-out part, less those about which the pass was linear, SI.
    covariance : array, shape (n, n)
    stretches : tuple of Predicted
        About the constants without the held-out part.
    """

    every: int
    layout: Layout
    step: FloatArray
    covariance: FloatArray
    stretches: tuple[Predicted, ...]


def held_out(case: Case, progress: Progress | None = None) -> HeldOut | None:
    """Predict a part of the recording from the rest of it.

    None where no part can be spared: the remainder would not determine the constants.
    """
    result = case.result
    for every in SPARSER:
        found = held_out_every(case, every, progress=progress)
        if found is None:
            continue
        base = sum(len(block.states) for block in BASE)
        sd = np.sqrt(np.diag(found.covariance)[:base])
        if (sd <= KEPT_SD * result.sd[:base]).all():
            return found
    return None


def held_out_every(
    case: Case, every: int, *, layout: Layout | None = None, progress: Progress | None = None
) -> HeldOut | None:
    """As `held_out`, with every so many rests held out, however little that leaves.

    `layout` may have further blocks after those of the result; the pass is linear about zero in
    their states.
    """
    result = case.result
    layout = layout or result.layout
    start = extended(result, layout)
    if north_of_each(result):
        start.p[layout.place(north.BLOCK.name)] = 0.0
    stretches = stretches_of(result.survey, every)
    whole = task_again(case.recording, result, layout, case.noise)
    found = without(result.survey, stretches)
    cuts = tuple(stretch.after.start_s for stretch in stretches)
    for _ in range(PASSES_MAX if layout is result.layout else 1):
        watch = StretchWatch(stretches, whole.frame, whole.noise, whole.wander, _end_s(result))
        task = replace(whole, survey=found, cuts_s=cuts, watch=watch)
        done = run_pass(task, start, first=False, progress=progress)
        predicted = watch.end()
        if not predicted:
            return None
        step = done.p - start.p
        sd = np.sqrt((done.root**2).sum(axis=1))
        if float(np.abs(step / sd).max()) < AGAIN_SD:
            break
        start = Reference(done.p, done.stage_p, start.heading_rad)
    about = tuple(replace(s, y=s.y - s.J @ step) for s in map(unseen_north(result), predicted))
    return HeldOut(every, layout, step, done.root @ done.root.T, about)


def north_of_each(result: DynamicResult) -> bool:
    """Whether each of several sections has a horizontal rate of the Earth of its own."""
    return north.BLOCK.name in result.layout and len(result.survey.sections) > 1


def unseen_north(result: DynamicResult) -> Callable[[Predicted], Predicted]:
    """Take the Earth's horizontal rate of a stretch's section as unknown, where each has its own.

    What the filter knows at its end is that of the last section.
    """
    if not north_of_each(result):
        return lambda predicted: predicted
    place = result.layout.place(north.BLOCK.name)
    sd = result.layout.prior_sd[place]

    def spread(predicted: Predicted) -> Predicted:
        J = predicted.J.copy()
        own, J[:, place] = J[:, place] * sd, 0.0
        return replace(predicted, J=J, noise=predicted.noise + own @ own.T)

    return spread


def _end_s(result: DynamicResult) -> float:
    windows = result.survey.windows
    return float(windows.start_s[-1] + windows.duration_s[-1])
