"""What the recording holds: sections without a gap, stand-stills, and axes put on the table.

The survey reads the recording once and keeps means over short windows; nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.plausibility import refuse_wrong_units
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.windows import WINDOW_S, Windows, read_windows
from triaxcal.model.types import BoolArray, FloatArray, IntArray

STILL_MIN_S = 5.0
"""Shortest stand-still that an alignment may start from."""
STILL_RAD_PER_S = np.radians(0.25)
"""Change of the rate, against the stand-still before, that is no noise any more."""
AXIS_COSINE = np.cos(np.radians(25.0))
"""A turn counts as one about an instrument axis within 25 deg."""
AXIS_TURN_MIN_RAD = 2 * np.pi
"""An axis that turned less in all was never put on the table."""
REST_MAX_RAD_PER_S = np.radians(25.0)
"""Data sheets of the coarsest gyros allow 20 deg/s at rest: a section that starts faster turns."""
REST_FORCE_COSINE = np.cos(np.radians(5.0))
"""Gravity leans by less at rest: 1 deg/s about a level axis shows in `STILL_MIN_S`."""
STAGE_TURN_RAD = np.pi
"""Less than half a turn about an axis is handling, not a stage."""
STILL_SD = 5.0
STILL_MAX_RAD_PER_S = np.radians(3.0)
"""A noisy gyro is given so many deviations of a window's mean, by its first seconds."""
GUARD_S = 2.0
"""Around handling nothing is used: what lifts the unit starts and ends slowly."""


@dataclass(frozen=True)
class Stage:
    """One axis on the table.

    Attributes
    ----------
    axis : int
        Instrument axis 0, 1, 2 that the unit turned about.
    start_s, end_s : float
        From the stand-still before its first turn to the end of its last.
    turned_rad : float
        Sum of the turns, both senses.
    """

    axis: int
    start_s: float
    end_s: float
    turned_rad: float


@dataclass(frozen=True)
class Section:
    """Samples without a gap between them, which begin with a stand-still.

    Attributes
    ----------
    first, last : int
        Numbers of the samples.
    start_s, still_s : float
        Time of the first sample; length of the stand-still.
    rate, force : arrays, shape (3,)
        Means over the stand-still, as measured.
    """

    first: int
    last: int
    start_s: float
    still_s: float
    rate: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Survey:
    """Everything the filter must know of a recording before it starts.

    Attributes
    ----------
    windows : Windows
    sections : tuple of Section
    stages : tuple of Stage
    use : array, shape (w,), bool
        Windows in which the unit stands or turns on the table; the others are handling.
    still : array, shape (w,), bool
    rate_max : float
        Largest mean rate in a window, rad/s.
    """

    windows: Windows
    sections: tuple[Section, ...]
    stages: tuple[Stage, ...]
    use: BoolArray
    still: BoolArray
    rate_max: float

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        w = self.windows
        return float(w.start_s[-1] + w.duration_s[-1] - w.start_s[0])


def survey(recording: ImuRecording) -> Survey:
    """Read a recording once.

    Raises
    ------
    RefusedError
        As `read_windows` and `refuse_wrong_units`; when a section does not begin with a stand-still
        of `STILL_MIN_S`; when an axis was never rotated.
    """
    windows, edges = read_windows(recording)
    refuse_wrong_units(recording, windows)
    sections, still = [], np.zeros(len(windows.first), dtype=bool)
    for number, (first, last) in enumerate(edges):
        inside = np.flatnonzero(windows.section == number)
        section, standing = _section(recording.name, windows, inside, first, last)
        sections.append(section)
        still[inside] = standing
    stages, use = _stages(windows, sections, still, recording.starts_s)
    _refuse_missing_axis(recording.name, windows, still, sections)
    speed = np.linalg.norm(windows.rate, axis=1)
    rate_max = float(speed.max())
    return Survey(windows, tuple(sections), stages, use, still, rate_max)


def _section(
    name: str, windows: Windows, inside: IntArray, first: int, last: int
) -> tuple[Section, BoolArray]:
    """Stand-still at the start of a section, and which of its windows stand."""
    rate, start = windows.rate[inside], windows.start_s[inside]
    few = max(2, round(2.0 / WINDOW_S))
    reference = np.median(rate[:few], axis=0)
    begin = rate[: round(STILL_MIN_S / WINDOW_S)]
    noise = 1.4826 * np.median(np.abs(np.diff(begin, axis=0)), axis=0).max() / np.sqrt(2)
    limit = min(max(STILL_RAD_PER_S, STILL_SD * noise), STILL_MAX_RAD_PER_S)
    standing: BoolArray = np.abs(rate - reference).max(axis=1) < limit
    run = len(standing) if standing.all() else int(np.argmin(standing))
    length_s = float(windows.duration_s[inside][:run].sum())
    found = ""
    if length_s < STILL_MIN_S:
        found = f"is at rest for {length_s:.1f} s, then " + (
            f"turns at {np.degrees(np.linalg.norm(rate[run] - reference)):.1f} deg/s"
            if run < len(rate)
            else "the recording ends or has a gap"
        )
    elif _turns_evenly(reference, windows.force[inside][: round(STILL_MIN_S / WINDOW_S)]):
        found = f"is not at rest: turns at {np.degrees(np.linalg.norm(reference)):.1f} deg/s"
    if found:
        raise RefusedError(
            f"{name}, {start[0]:.1f} s",
            found if first == 0 else f"after a gap the unit {found}",
            expected=f"at least {STILL_MIN_S:.0f} s at rest at the start and after each gap",
            remedy="keep the unit at rest before the first turn, and lose no samples in the turns",
        )
    kept = slice(0, max(1, run - 1))
    mean_rate, mean_force = rate[kept].mean(axis=0), windows.force[inside][kept].mean(axis=0)
    return Section(first, last, float(start[0]), length_s, mean_rate, mean_force), standing


def _turns_evenly(rate: FloatArray, force: FloatArray) -> bool:
    """Whether a section starts in an even turn, which to the gyros alone looks like a bias.

    Medians of seconds: one spoiled sample is no turn.
    """
    second = round(1.0 / WINDOW_S)
    seconds = [np.median(force[k : k + second], axis=0) for k in range(0, len(force), second)]
    direction = np.array([f / np.linalg.norm(f) for f in seconds])
    leans = bool((direction @ direction[0]).min() < REST_FORCE_COSINE)
    return leans or float(np.linalg.norm(rate)) > REST_MAX_RAD_PER_S


def _stages(
    windows: Windows, sections: list[Section], still: BoolArray, anew: tuple[float, ...] = ()
) -> tuple[tuple[Stage, ...], BoolArray]:
    """Stages, and the windows that belong to one or stand still.

    `anew` are times of further recordings: the unit was put on the table anew.
    """
    bias = np.array([section.rate for section in sections])[windows.section]
    rate = windows.rate - bias
    speed = np.linalg.norm(rate, axis=1)
    axis = np.argmax(np.abs(rate), axis=1)
    along = np.abs(rate[np.arange(len(rate)), axis]) >= AXIS_COSINE * speed
    label = np.where(still, -1, np.where(along, axis, -2))
    turning = np.flatnonzero(label != -1)
    use = still.copy()
    stages: list[Stage] = []
    if len(turning) == 0:
        return (), use
    # Runs of turning windows about the same axis of the same section, stand-stills disregarded.
    key = label[turning] + 4 * windows.section[turning]
    breaks = np.flatnonzero(np.diff(key)) + 1
    end_before = windows.start_s[0]
    for run in np.split(turning, breaks):
        turned = float((speed[run] * windows.duration_s[run]).sum())
        kind = int(label[run[0]])
        end = float(windows.start_s[run[-1]] + windows.duration_s[run[-1]])
        if kind >= 0 and turned >= STAGE_TURN_RAD:
            use[run] = True
            last = stages[-1] if stages else None
            moved = last is None or any(last.start_s < s <= windows.start_s[run[0]] for s in anew)
            if last is not None and last.axis == kind and not moved:
                stages[-1] = Stage(kind, last.start_s, end, last.turned_rad + turned)
            else:
                stages.append(Stage(kind, float(end_before), end, turned))
        end_before = end
    return tuple(stages), use & ~_widened(~use, round(GUARD_S / WINDOW_S))


def _widened(marked: BoolArray, by: int) -> BoolArray:
    """Marks, and `by` windows more on each side of them."""
    near: BoolArray = np.convolve(marked.astype(np.float64), np.ones(2 * by + 1), mode="same") > 0.5
    return near


def _refuse_missing_axis(
    name: str, windows: Windows, still: BoolArray, sections: list[Section]
) -> None:
    bias = np.array([section.rate for section in sections])[windows.section]
    turns = np.abs(windows.rate - bias) * windows.duration_s[:, None]
    for axis, turn in enumerate(turns[~still].sum(axis=0)):
        if turn < AXIS_TURN_MIN_RAD:
            raise RefusedError(
                name,
                f"turns about axis {'xyz'[axis]} by {turn / (2 * np.pi):.2f} revolutions in all",
                expected="some revolutions about each axis x, y, z in turn",
                remedy="put that axis along the table's and rotate",
            )
