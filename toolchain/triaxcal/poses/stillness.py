"""Where a recording is still: a threshold sweep over the activity of its samples.

Activity is the standard deviation of the readings within a short window, all axes together, over
its own floor (the tenth percentile); with a gyro, the larger of the two ratios. Still is what stays
below a threshold. Too low a threshold cuts poses into pieces, too high a one joins them; between
lies a plateau on which their number does not change. The middle of the longest plateau is taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.samples import GAP, GYRO, READING, Samples
from triaxcal.readings.spool import Spool
from triaxcal.readings.table import LABEL, TIME

WINDOW_S = 0.5
WINDOW_MIN = 8
"""Samples: the deviation of fewer scatters by more than a quarter."""
THRESHOLDS = tuple(1.25 * 2.0 ** (k / 4.0) for k in range(21))
"""1.25 to 40 times the floor, four a doubling."""
_FLOOR_PERCENTILE = 10.0
_NOTED = 0.25
"""Of the shortest pose: stretches at rest shorter than this are part of the movement."""


@dataclass(frozen=True)
class Step:
    """One threshold of the sweep: in units of the floor, and what it finds."""

    threshold: float
    poses: int
    still_s: float


@dataclass(frozen=True)
class Stillness:
    """The sweep and its choice.

    Attributes
    ----------
    time_s, activity : arrays, shape (m,)
        For pictures: evenly spaced samples of a long recording, all of a short one; activity in
        units of the floor.
    steps : tuple of Step
    chosen : int
        Index of the step taken.
    runs : tuple of (start, stop)
        Still stretches at that threshold of a quarter of the shortest pose and more, as indices of
        samples, stop excluded; shorter ones are part of the movement.
    """

    time_s: FloatArray
    activity: FloatArray
    steps: tuple[Step, ...]
    chosen: int
    runs: tuple[tuple[int, int], ...]

    @property
    def threshold(self) -> float:
        """Chosen threshold, in units of the floor."""
        return self.steps[self.chosen].threshold


def find_stillness(samples: Samples, still_s: float) -> Stillness:
    """Sweep the threshold and choose; `still_s` is the shortest pose."""
    activity = _Activity(samples)
    found = _runs(samples, activity, THRESHOLDS, still_s)
    steps = tuple(
        Step(threshold, len(runs), sum(runs[:, 2].tolist()))
        for threshold, runs in zip(THRESHOLDS, found, strict=True)
    )
    chosen = _plateau([step.poses for step in steps])
    (runs,) = _runs(samples, activity, THRESHOLDS[chosen : chosen + 1], _NOTED * still_s)
    return Stillness(
        samples.cut(samples.table.spool.thinned(), TIME),
        activity.of(activity.spool.thinned()),
        steps,
        chosen,
        tuple((int(start), int(stop)) for start, stop, _ in runs),
    )


def duration_s(samples: Samples, run: tuple[int, int]) -> float:
    """Length of a run in seconds, each sample standing for a step."""
    start, stop = run
    return samples.one(TIME, stop - 1) - samples.one(TIME, start) + samples.step_s


def _plateau(counts: list[int]) -> int:
    """Middle of the longest run of equal counts above zero, the larger count among equals."""
    best = (0, 0, 0)
    start = 0
    for k in range(1, len(counts) + 1):
        if k == len(counts) or counts[k] != counts[start]:
            best = max(best, (k - start if counts[start] else 0, counts[start], -start))
            start = k
    length, _, negative = best
    return -negative + (length - 1) // 2 if length else len(counts) // 2


class _Activity:
    """Deviations within a short window, and their floors, of all samples."""

    def __init__(self, samples: Samples) -> None:
        window = max(WINDOW_MIN, math.ceil(WINDOW_S / samples.step_s))
        names = [name for name in (READING, GYRO) if name in samples]
        means = {name: samples.mean(name, 0, len(samples)) for name in names}
        self.spool = Spool(len(names))
        for first, rows in samples.pieces():
            parts = [
                _deviation(samples, name, means[name], window, first + np.arange(len(rows)))
                for name in names
            ]
            self.spool.append(np.column_stack(parts))
        seen = np.concatenate(self.spool.stretches())
        self._floors = np.array([_floor(column) for column in seen.T.copy()])

    def of(self, rows: FloatArray) -> FloatArray:
        """Activity, (n,), of rows of the spool."""
        activity: FloatArray = (rows / self._floors).max(axis=1)
        return activity


def _floor(deviation: FloatArray) -> float:
    floor = float(np.percentile(deviation, _FLOOR_PERCENTILE))
    if floor > 0.0:
        return floor
    # Readings that do not even flicker: the smallest deviation that is seen stands in.
    positive = deviation[deviation > 0.0]
    return float(np.percentile(positive, _FLOOR_PERCENTILE)) if len(positive) else 1.0


def _deviation(
    samples: Samples, name: str, mean: FloatArray, window: int, index: IntArray
) -> FloatArray:
    """Root of the summed variances within a window about each sample of consecutive ones, (n,)."""
    n = len(samples)
    start = np.clip(index - window // 2, 0, max(n - window, 0))
    stop = np.minimum(start + window, n)
    # Windows reach beyond the piece: what lies on either side is read with it.
    centred = samples.part(name, int(start[0]), int(stop[-1])) - mean
    start, stop = start - start[0], stop - start[0]
    zero = np.zeros((1, centred.shape[1]))
    sums = np.concatenate([zero, np.cumsum(centred, axis=0)])
    squares = np.concatenate([zero, np.cumsum(centred**2, axis=0)])
    count = (stop - start)[:, None]
    inner = (sums[stop] - sums[start]) / count
    variance = np.maximum((squares[stop] - squares[start]) / count - inner**2, 0.0)
    result: FloatArray = np.sqrt(variance.sum(axis=1))
    return result


def _runs(
    samples: Samples, activity: _Activity, thresholds: Sequence[float], shortest_s: float
) -> list[FloatArray]:
    """Still stretches of `shortest_s` and more at each threshold, shape (runs, 3).

    Columns are start, stop (excluded) and duration in s. Gaps in time and changes of the section
    cut a stretch.
    """
    scans = [_Scan(threshold, shortest_s, samples.step_s) for threshold in thresholds]
    before_s, before_label = 0.0, math.nan
    for first, rows in samples.pieces():
        time_s = samples.cut(rows, TIME)
        earlier_s = np.append(before_s, time_s[:-1])
        cuts = time_s - earlier_s > GAP * samples.step_s
        if LABEL in samples:
            labels = samples.cut(rows, LABEL)
            cuts |= labels != np.append(before_label, labels[:-1])
            before_label = float(labels[-1])
        level = activity.of(activity.spool.rows(first, first + len(rows)))
        for scan in scans:
            scan.go_on(first, level, cuts, time_s, earlier_s)
        before_s = float(time_s[-1])
    return [scan.closed(len(samples), before_s) for scan in scans]


class _Scan:
    """Still stretches at one threshold, piece after piece."""

    def __init__(self, threshold: float, shortest_s: float, step_s: float) -> None:
        self._threshold, self._shortest_s, self._step_s = threshold, shortest_s, step_s
        self._open = np.empty((0, 2))  # start and its time of a stretch that goes on
        self._found: list[FloatArray] = []

    def go_on(
        self,
        first: int,
        level: FloatArray,
        cuts: BoolArray,
        time_s: FloatArray,
        earlier_s: FloatArray,
    ) -> None:
        """Take the next samples, from index `first` on."""
        still = level < self._threshold
        before = np.append(len(self._open) > 0, still[:-1])
        begins = np.flatnonzero(still & (cuts | ~before))
        ends = np.flatnonzero(before & (cuts | ~still))
        starts = np.vstack([self._open, np.column_stack([first + begins, time_s[begins]])])
        self._open = starts[len(ends) :]
        self._add(starts[: len(ends)], first + ends, earlier_s[ends])

    def closed(self, count: int, last_s: float) -> FloatArray:
        """All stretches, with the one that goes on to the end."""
        self._add(self._open, np.full(len(self._open), count), np.full(len(self._open), last_s))
        return np.concatenate(self._found)

    def _add(self, starts: FloatArray, stops: IntArray, last_s: FloatArray) -> None:
        length = last_s - starts[:, 1] + self._step_s
        kept = length >= self._shortest_s
        self._found.append(np.column_stack([starts[kept, 0], stops[kept], length[kept]]))
