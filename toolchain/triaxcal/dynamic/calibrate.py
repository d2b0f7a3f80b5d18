"""The whole road from a recording to the constants: survey, passes, result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks import north
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.filterpass import EARTH_RATE_RAD_PER_S, run_pass, taped_pass
from triaxcal.dynamic.instability import expected, usual
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet, not_stated
from triaxcal.dynamic.passdata import PassResult, Reference, Task
from triaxcal.dynamic.polled import at_least_seen
from triaxcal.dynamic.poses import StaticComparison, StaticPoses, compared, static_poses
from triaxcal.dynamic.preintegrate import NODES
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.restnoise import with_rests
from triaxcal.dynamic.survey import Survey, survey
from triaxcal.dynamic.wander import wander_of
from triaxcal.dynamic.window import Frame
from triaxcal.model.types import FloatArray

BLOCK_TURN_RAD = 0.2
BLOCK_MAX_S = 0.5
HEADING_SD_MAX_RAD = 0.3
"""Where the Earth's horizontal rate is known better than this, its direction is the heading."""
TOO_FAST_SD = 4.0
"""A rate beyond the Earth's by so many standard deviations has no direction of the north."""
PASSES_MAX = 12
"""To settle once; where the noise is found on the way, the passes settle twice."""
SETTLED_SD = 0.05
"""A pass that moves no constant by more than this part of its standard deviation is the last."""
LEAST_PART = 0.5
"""Least part of a step that is taken: where the heading is known to some ten degrees only, whole
steps may swing wider and wider about the minimum."""
MOVES = 100
"""Of the fastest wandering states, in a recording whose bias instability is still looked for."""

Progress = Callable[[int, float], None]
"""Number of the pass and the part of it that is done."""


@dataclass(frozen=True)
class DynamicResult:
    """Constants of an IMU from one recording.

    Attributes
    ----------
    layout : Layout
    p, sd : arrays, shape (n,)
        Constants and standard deviations, SI, in the order of `layout.states`.
    covariance : array, shape (n, n)
    stage_p : array, shape (stages, r)
        Values at each mounting of the states that are new there.
    heading_rad : array or None
        Of each section's level frame; None where the unit cannot see the north.
    survey : Survey
    noise : DataSheet
        What the filter used.
    estimated : tuple of str
        Keys of it that were not stated: from the recording itself.
    frame : Frame
        Of the last pass; its layout has the wandering biases after the constants.
    passes : tuple of PassResult
        The last one gave the result.
    static : StaticComparison
        The accelerometers against what the rests alone say.
    """

    layout: Layout
    p: FloatArray
    sd: FloatArray
    covariance: FloatArray
    stage_p: FloatArray
    heading_rad: FloatArray | None
    survey: Survey
    noise: DataSheet
    estimated: tuple[str, ...]
    frame: Frame
    passes: tuple[PassResult, ...]
    static: StaticComparison


class NotSettledError(RefusedError):
    """The passes do not settle: no constants describe the recording."""


def calibrate_dynamic(
    recording: ImuRecording, noise: DataSheet, blocks: tuple[StateBlock, ...] = (), *,
    reference_degc: float = 20.0, progress: Progress | None = None,
) -> DynamicResult:  # fmt: skip
    """Constants of the base model and of the `blocks` that are switched on besides.

    Raises
    ------
    RefusedError
        As `survey` and `static_poses`; when the passes do not settle.
    """
    found = survey(recording)
    wanted = Layout((*BASE, *blocks))
    searching = Layout((*wanted.blocks, north.BLOCK))
    size = _block_size(recording, found)
    duration_s = found.duration_s
    stated, noise = noise, at_least_seen(recording, with_rests(recording.name, found, noise))
    decided = noise == usual(noise)
    noise = usual(noise)
    static = static_poses(recording, found, noise)
    found = found.without(static.left_out)
    start = _first_reference(searching, recording, found, static)
    passes: list[PassResult] = []
    part_of_step, step = 1.0, np.zeros(0)
    allowed = PASSES_MAX if decided else 2 * PASSES_MAX
    for number in range(allowed):
        layout = searching if start.heading_rad is None else wanted
        wander = wander_of(layout, noise, duration_s, 0.0 if decided else duration_s / MOVES)
        frame = _frame(wander.layout, recording, size, reference_degc)
        report = partial(progress, number) if progress is not None else _no_report
        task = Task(recording, found, frame, noise, wander)
        done = run_pass(task, start, first=number == 0, progress=report)
        passes.append(done)
        n = len(wanted)
        sd = np.sqrt((done.root**2).sum(axis=1))
        last_step, step = step, (done.p - start.p)[:n] / sd[:n]
        moved = float(np.abs(step).max())
        before = start.heading_rad
        if number >= 2 and before is not None:
            part_of_step = _part_of_step(part_of_step, step, last_step)
        start = _next_reference(start, done, n, recording, part_of_step)
        same_kind = (before is None) == (start.heading_rad is None)
        settled = number >= 2 and moved < SETTLED_SD and same_kind
        if settled and not decided:
            noise = expected(stated, noise, taped_pass(task, start), wander)
            decided = True
        elif settled:
            covariance = done.root @ done.root.T
            shown = (done.p, sd, covariance, done.stage_p, start.heading_rad, found)
            used = noise, not_stated(stated, noise)
            beside = compared(static, layout, done.p, sd)
            return DynamicResult(layout, *shown, *used, frame, tuple(passes), beside)
    raise NotSettledError(
        recording.name,
        f"after {allowed} passes the constants still move by {moved:.1f} standard deviations",
        expected="a recording that the model describes",
        remedy="check "
        + "that all recordings are of one unit, their temperatures, " * bool(recording.starts_s)
        + "units, axes, conventions and the noise that unit.toml states",
    )


def _part_of_step(part: float, step: FloatArray, last: FloatArray) -> float:
    """Part of `step` to take after the `part` of the `last` one was taken.

    Steps in proportion to the distance from the minimum change by 1 - part mu from one to the next,
    so that 1/mu is the part that arrives there: the method of secants.
    """
    ratio = float(step @ last / (last @ last))
    return 1.0 if ratio >= 1.0 - LEAST_PART else max(LEAST_PART, min(1.0, part / (1.0 - ratio)))


def _no_report(part: float) -> None:
    """Nobody wants to see the progress."""


def _frame(layout: Layout, recording: ImuRecording, size: int, reference_degc: float) -> Frame:
    conventions = recording.rate_convention, recording.force_convention
    gravity, interval_s = recording.gravity_m_per_s2, 1 / recording.rate_hz
    part = 1.0 if recording.force_hz is None else recording.force_hz * interval_s
    return Frame(layout, *conventions, gravity, size, interval_s, reference_degc, part)


def _block_size(recording: ImuRecording, found: Survey) -> int:
    """Samples of a block: a turn of about `BLOCK_TURN_RAD` at the fastest, in whole nodes."""
    unit = 2 * NODES
    longest = BLOCK_MAX_S * recording.rate_hz
    turn = BLOCK_TURN_RAD / max(found.rate_max, 1e-9) * recording.rate_hz
    return max(1, int(min(longest, turn) // unit)) * unit


def _first_reference(
    layout: Layout, recording: ImuRecording, found: Survey, static: StaticPoses
) -> Reference:
    """The accelerometers as the rests alone say, if they do, and the gyros' biases as seen at rest.

    Those have the Earth's vertical rate taken off; everything else is zero.
    """
    p = np.zeros(len(layout))
    if static.determined:
        p[: len(static.p)] = static.p
    section = found.sections[0]
    up = section.force / np.linalg.norm(section.force)
    vertical = EARTH_RATE_RAD_PER_S * math.sin(math.radians(recording.latitude_deg))
    p[layout.place("gyro-bias")] = section.rate - up * vertical
    resets = len(layout.reset_columns())
    return Reference(p, np.zeros((max(1, len(found.stages)), resets)), None)


def _next_reference(
    start: Reference, done: PassResult, n: int, recording: ImuRecording, part: float
) -> Reference:
    """Where the next pass linearises: the `part` of the way to what this one found."""
    horizontal = EARTH_RATE_RAD_PER_S * math.cos(math.radians(recording.latitude_deg))
    if start.heading_rad is not None:
        return Reference(
            start.p + part * (done.p - start.p),
            start.stage_p + part * (done.stage_p - start.stage_p),
            start.heading_rad + part * done.heading_change_rad,
        )
    rate, sd = done.north[:, 0], done.north[:, 1]
    if _too_fast(rate, sd) or float(sd.max()) > HEADING_SD_MAX_RAD * horizontal:
        return Reference(done.p, done.stage_p, None)
    heading = math.pi / 2 - np.arctan2(rate[:, 1], rate[:, 0])
    return Reference(done.p[:n], done.stage_p, heading)


def _too_fast(rate: FloatArray, sd: FloatArray) -> bool:
    """Whether horizontal rates (sections, 2) are beyond the Earth's whole rate: no heading."""
    size = np.linalg.norm(rate, axis=1)
    return bool((size > EARTH_RATE_RAD_PER_S + TOO_FAST_SD * sd.max(axis=1)).any())
