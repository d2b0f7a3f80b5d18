"""What the recording holds: sections without a gap, stand-stills, and axes put on the table.

The survey reads the recording once and keeps means over short windows; nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from triaxcal.dynamic.recording import INCREMENT, ImuRecording
from triaxcal.errors import RefusedError
from triaxcal.model.types import FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]

WINDOW_S = 0.25
STILL_MIN_S = 10.0
"""Shortest stand-still that an alignment may start from."""
STILL_RAD_PER_S = np.radians(0.25)
"""Change of the rate, against the stand-still before, that is no noise any more."""
GAP_INTERVALS = 1.5
"""A step of time longer than so many intervals is a gap."""
AXIS_COSINE = np.cos(np.radians(25.0))
"""A turn counts as one about an instrument axis within 25 deg."""
STAGE_TURN_RAD = np.pi
"""Less than half a turn about an axis is handling, not a stage."""
GUARD_S = 2.0
"""Around handling nothing is believed: what lifts the unit starts and ends slowly."""
CHUNK = 1 << 16


@dataclass(frozen=True)
class Windows:
    """Means over windows of `WINDOW_S`.

    Attributes
    ----------
    start_s, duration_s : arrays, shape (w,)
    first : array, shape (w,)
        Number of the first sample.
    rate, force : arrays, shape (w, 3)
        rad/s, m/s^2, as measured.
    section : array, shape (w,)
        Number of the section without a gap.
    """

    start_s: FloatArray
    duration_s: FloatArray
    first: IntArray
    rate: FloatArray
    force: FloatArray
    section: IntArray


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
        Largest mean rate in a stage, rad/s.
    temp_mean_degc : float
        nan where there is no temperature.
    """

    windows: Windows
    sections: tuple[Section, ...]
    stages: tuple[Stage, ...]
    use: BoolArray
    still: BoolArray
    rate_max: float
    temp_mean_degc: float


def survey(recording: ImuRecording) -> Survey:
    """Read a recording once.

    Raises
    ------
    RefusedError
        When a section does not begin with a stand-still of `STILL_MIN_S`.
    """
    windows, edges, temp_mean = _windows(recording)
    sections, still = [], np.zeros(len(windows.first), dtype=bool)
    for number, (first, last) in enumerate(edges):
        inside = np.flatnonzero(windows.section == number)
        section, standing = _section(recording.name, windows, inside, first, last)
        sections.append(section)
        still[inside] = standing
    stages, use = _stages(windows, sections, still)
    speed = np.linalg.norm(windows.rate, axis=1)
    rate_max = float(speed[use].max())
    return Survey(windows, tuple(sections), stages, use, still, rate_max, temp_mean)


def _windows(recording: ImuRecording) -> tuple[Windows, list[tuple[int, int]], float]:
    length = max(1, round(WINDOW_S * recording.rate_hz))
    interval = 1 / recording.rate_hz
    rows: list[tuple[Any, ...]] = []
    edges: list[tuple[int, int]] = [(0, -1)]
    previous_s, count = None, 0
    temps = []
    for chunk in recording.chunks(CHUNK // length * length):
        step = np.diff(chunk.time_s, prepend=chunk.time_s[0] - interval)
        if previous_s is not None:
            step[0] = chunk.time_s[0] - previous_s
        cuts = [0, *np.flatnonzero(step > GAP_INTERVALS * interval), len(chunk)]
        rate = chunk.rate / step[:, None] if recording.rate_convention == INCREMENT else chunk.rate
        force = chunk.force
        if recording.force_convention == INCREMENT:
            force = force / step[:, None]
        for number, (a, b) in enumerate(pairwise(cuts)):
            if number > 0:
                edges[-1] = (edges[-1][0], count + int(a) - 1)
                edges.append((count + int(a), -1))
            begin = int(a) + (1 if number > 0 else 0)  # an increment over a gap is none
            starts = np.arange(begin, int(b), length)
            if len(starts) == 0:
                continue
            sizes = np.diff(starts, append=int(b))
            rows.append(
                (
                    chunk.time_s[starts],
                    sizes * interval,
                    count + starts,
                    np.add.reduceat(rate[: int(b)], starts) / sizes[:, None],
                    np.add.reduceat(force[: int(b)], starts) / sizes[:, None],
                    np.full(len(starts), len(edges) - 1),
                )
            )
        if chunk.temp_degc is not None:
            temps.append(float(chunk.temp_degc.mean()))
        count += len(chunk)
        previous_s = float(chunk.time_s[-1])
    edges[-1] = (edges[-1][0], count - 1)
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return Windows(*columns), edges, float(np.mean(temps)) if temps else float("nan")


def _section(
    name: str, windows: Windows, inside: IntArray, first: int, last: int
) -> tuple[Section, BoolArray]:
    """Stand-still at the start of a section, and which of its windows stand."""
    rate, start = windows.rate[inside], windows.start_s[inside]
    few = max(2, round(2.0 / WINDOW_S))
    reference = np.median(rate[:few], axis=0)
    standing: BoolArray = np.abs(rate - reference).max(axis=1) < STILL_RAD_PER_S
    run = len(standing) if standing.all() else int(np.argmin(standing))
    length_s = float(windows.duration_s[inside][:run].sum())
    if length_s < STILL_MIN_S:
        speed = np.degrees(np.linalg.norm(rate[run] - reference)) if run < len(rate) else 0.0
        raise RefusedError(
            f"{name}, {start[0]:.1f} s",
            f"stands still for {length_s:.1f} s, then turns at {speed:.1f} deg/s",
            expected=f"at least {STILL_MIN_S:.0f} s at rest at the start and after each gap",
            remedy="let the unit stand before the first turn",
        )
    kept = slice(0, max(1, run - 1))
    mean_rate, mean_force = rate[kept].mean(axis=0), windows.force[inside][kept].mean(axis=0)
    return Section(first, last, float(start[0]), length_s, mean_rate, mean_force), standing


def _stages(
    windows: Windows, sections: list[Section], still: BoolArray
) -> tuple[tuple[Stage, ...], BoolArray]:
    """Stages, and the windows that belong to one or stand still."""
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
            if last is not None and last.axis == kind:
                stages[-1] = Stage(kind, last.start_s, end, last.turned_rad + turned)
            else:
                stages.append(Stage(kind, float(end_before), end, turned))
        end_before = end
    return tuple(stages), use & ~_widened(~use, round(GUARD_S / WINDOW_S))


def _widened(marked: BoolArray, by: int) -> BoolArray:
    """Marks, and `by` windows more on each side of them."""
    near: BoolArray = np.convolve(marked.astype(np.float64), np.ones(2 * by + 1), mode="same") > 0.5
    return near
