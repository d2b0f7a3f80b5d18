"""What the recording holds: sections without a gap, rests, and axes put on the table.

The survey reads the recording once and keeps means over short windows; nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.dynamic.clipping import cut_at_clips
from triaxcal.dynamic.plausibility import refuse_wrong_units
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.restless import no_rest, refuse_few_rests, refuse_missing_axis
from triaxcal.dynamic.rests import REST_MIN_S, Quiet, even_in_runs, guard_of, quiet_windows, runs_of
from triaxcal.dynamic.stages import Stage, find_stages
from triaxcal.dynamic.tablesense import refuse_other_angles
from triaxcal.dynamic.windows import WINDOW_S, Windows, read_windows
from triaxcal.model.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Section:
    """Samples without a gap between them, which begin with a rest.

    Attributes
    ----------
    first, last : int
        Numbers of the samples.
    start_s, still_s : float
        Time of the first sample; length of the rest.
    rate, force : arrays, shape (3,)
        Means over the rest, as measured.
    """

    first: int
    last: int
    start_s: float
    still_s: float
    rate: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Rest:
    """A stretch in which the unit does not move, without the guards at its edges.

    Attributes
    ----------
    first, end : int
        Number of the first window and of the one after the last.
    start_s, duration_s : float
    force : array, shape (3,)
        Mean, m/s^2, as measured.
    force_scatter : float
        Standard deviation of the samples within a window, m/s^2; median over the windows.
    """

    first: int
    end: int
    start_s: float
    duration_s: float
    force: FloatArray
    force_scatter: float


@dataclass(frozen=True)
class Survey:
    """Everything the filter must know of a recording before it starts.

    Attributes
    ----------
    windows : Windows
        Those of sections without a rest have the section -1.
    sections : tuple of Section
    stages : tuple of Stage
    rests : tuple of Rest
    use : array, shape (w,), bool
        Windows in which the accelerometers are used: rests, and turns on the table.
    still : array, shape (w,), bool
    rate_max : float
        Largest mean rate in a window, rad/s.
    guard_s : float
        Cut from a rest where it meets a motion that is not the table's.
    findings : tuple of str
        What of the recording is not used.
    """

    windows: Windows
    sections: tuple[Section, ...]
    stages: tuple[Stage, ...]
    rests: tuple[Rest, ...]
    use: BoolArray
    still: BoolArray
    rate_max: float
    guard_s: float
    findings: tuple[str, ...] = ()

    def without(self, starts_s: tuple[float, ...]) -> Survey:
        """The same without the rests that begin at `starts_s`."""
        if not starts_s:
            return self
        use = self.use.copy()
        out = [rest for rest in self.rests if rest.start_s in starts_s]
        for rest in out:
            use[rest.first : rest.end] = False
        said = [f"rest at {rest.start_s:.1f} s: contradicts the others, not used" for rest in out]
        kept = tuple(rest for rest in self.rests if rest.start_s not in starts_s)
        return replace(self, rests=kept, use=use, findings=(*self.findings, *said))

    @cached_property
    def _unused(self) -> IntArray:
        """Number of windows before each that are not used."""
        return np.concatenate([[0], np.cumsum(~self.use)]).astype(np.int64)

    def used_blocks(self, ends_s: FloatArray) -> IntArray:
        """1 for each block in all of whose windows the accelerometers are used, else 0.

        `ends_s` (blocks + 1,) are the ends of blocks that follow each other.
        """
        start_s = self.windows.start_s
        first = np.maximum(np.searchsorted(start_s, ends_s[:-1], side="right") - 1, 0)
        end = np.maximum(np.searchsorted(start_s, ends_s[1:] - 1e-6, side="left"), first + 1)
        whole: IntArray = (self._unused[end] == self._unused[first]).astype(np.int64)
        return whole

    @property
    def resting(self) -> BoolArray:
        """Windows of the rests, shape (w,)."""
        resting = np.zeros(len(self.use), dtype=bool)
        for rest in self.rests:
            resting[rest.first : rest.end] = True
        return resting

    @property
    def levels_s(self) -> FloatArray:
        """Ends of the rests after which the unit is moved by hand, s."""
        ends = [rest.end for rest in self.rests if not self.use[min(rest.end, len(self.use) - 1)]]
        return np.array([self.windows.start_s[end] for end in ends], dtype=np.float64)

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
        As `read_windows` and `refuse_wrong_units`; when the unit never rests; when an axis was
        never turned.
    """
    windows, edges, clips = cut_at_clips(*read_windows(recording))
    refuse_wrong_units(recording, windows)
    quiet = quiet_windows(windows, recording.starts_s)
    if quiet is None:
        raise no_rest(recording.name, windows)
    stages, turning = find_stages(windows, quiet, recording)
    refuse_other_angles(recording, windows, stages, quiet.bias)
    if stages:  # no hand holds the unit: what moves as slowly as one is the start of handling
        quiet = replace(quiet, calm=even_in_runs(windows, quiet))
    use, guard = _used(windows, quiet, turning)
    rests = _rests(windows, use & quiet.calm)
    if not rests:
        raise no_rest(recording.name, windows)
    sections, numbers, findings = _sections(windows, edges, use, rests)
    refuse_few_rests(recording.name, len(rests), bool(stages), len(sections) if clips else 1)
    windows = replace(windows, section=numbers[windows.section])
    refuse_missing_axis(recording.name, windows, quiet)
    rate_max = float(np.linalg.norm(windows.rate, axis=1).max())
    found = (tuple(sections), stages, rests, use, quiet.still, rate_max)
    return Survey(windows, *found, guard * WINDOW_S, (*clips, *findings))


def _used(windows: Windows, quiet: Quiet, turning: BoolArray) -> tuple[BoolArray, int]:
    """Windows in which the accelerometers are used, and the guard in windows.

    A rest beside a turn on the table is whole; where it meets anything else it is cut.
    """
    use = quiet.calm | turning
    rests = [
        (a, b, _meets_motion(use, windows, a - 1, a), _meets_motion(use, windows, b, b - 1))
        for a, b in runs_of(use & ~turning, windows.section)
        if b - a >= round(REST_MIN_S / WINDOW_S)
    ]
    guard = guard_of(windows, rests)
    use &= ~_widened(~use, guard)
    for a, b in runs_of(use, windows.section):
        if not turning[a:b].any() and b - a < round(REST_MIN_S / WINDOW_S):
            use[a:b] = False
    return use, guard


def _meets_motion(use: BoolArray, windows: Windows, outside: int, inside: int) -> bool:
    """Whether the window beside a rest exists, without a gap between, and moves."""
    if not 0 <= outside < len(use) or windows.section[outside] != windows.section[inside]:
        return False
    return bool(not use[outside])


def _widened(marked: BoolArray, by: int) -> BoolArray:
    """Marks, and `by` windows more on each side of them."""
    near: BoolArray = np.convolve(marked.astype(np.float64), np.ones(2 * by + 1), mode="same") > 0.5
    return near


def _rests(windows: Windows, resting: BoolArray) -> tuple[Rest, ...]:
    found = []
    for a, b in runs_of(resting, windows.section):
        if b - a < round(REST_MIN_S / WINDOW_S):
            continue
        duration = float(windows.duration_s[a:b].sum())
        force = np.average(windows.force[a:b], axis=0, weights=windows.duration_s[a:b])
        scatter = float(np.median(windows.force_scatter[a:b]))
        found.append(Rest(a, b, float(windows.start_s[a]), duration, force, scatter))
    return tuple(found)


def _sections(
    windows: Windows, edges: list[tuple[int, int]], use: BoolArray, rests: tuple[Rest, ...]
) -> tuple[list[Section], IntArray, list[str]]:
    """Sections from their first rest on, their new numbers, and what is left out for want of one.

    A section without a rest has the number -1.
    """
    sections: list[Section] = []
    numbers = np.full(len(edges), -1, dtype=np.int64)
    lost_s: list[tuple[float, float]] = []
    for number, (first, last) in enumerate(edges):
        inside = np.flatnonzero(windows.section == number)
        if len(inside) == 0:
            continue
        start_s = float(windows.start_s[inside[0]])
        rest = next((r for r in rests if windows.section[r.first] == number), None)
        if rest is None:
            use[inside] = False
            lost_s.append((start_s, float(windows.duration_s[inside].sum())))
            continue
        begin = first
        if rest.first > inside[0]:
            begin = int(windows.first[rest.first])
            lost_s.append((start_s, rest.start_s - start_s))
        rate = windows.rate[rest.first : rest.end].mean(axis=0)
        numbers[number] = len(sections)
        sections.append(Section(begin, last, rest.start_s, rest.duration_s, rate, rest.force))
    return sections, numbers, _lost_words(lost_s)


def _lost_words(lost_s: list[tuple[float, float]]) -> list[str]:
    """Words for what is before the first rest of a section, by its starts and lengths."""
    if not lost_s:
        return []
    places = f" in {len(lost_s)} places" if len(lost_s) > 1 else ""
    total_s = sum(length for _, length in lost_s)
    words = f"{total_s:.1f} s{places} are not used, the first at {lost_s[0][0]:.1f} s"
    return [f"{words}: what is before the first rest, and between a gap and the next one"]
