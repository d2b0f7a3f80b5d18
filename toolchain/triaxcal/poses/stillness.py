"""Where a recording is still: a threshold sweep over the activity of its samples.

Activity is the standard deviation of the readings within a short window, all axes together, over
its own floor (the tenth percentile); with a gyro, the larger of the two ratios. Still is what stays
below a threshold. Too low a threshold cuts poses into pieces, too high a one joins them; between
lies a plateau on which their number does not change. The middle of the longest plateau is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.samples import Samples

WINDOW_S = 0.5
WINDOW_MIN = 8
"""Samples: the deviation of fewer scatters by more than a quarter."""
THRESHOLDS = tuple(1.25 * 2.0 ** (k / 4.0) for k in range(21))
"""1.25 to 40 times the floor, four a doubling."""
_FLOOR_PERCENTILE = 10.0


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
    activity : array, shape (n,)
        In units of the floor.
    steps : tuple of Step
    chosen : int
        Index of the step taken.
    runs : tuple of (start, stop)
        Still stretches at that threshold, as indices of samples, stop excluded.
    """

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
    activity = _activity(samples)
    found = [_runs(samples, activity < threshold) for threshold in THRESHOLDS]
    steps = []
    for threshold, runs in zip(THRESHOLDS, found, strict=True):
        long = [r for r in runs if duration_s(samples, r) >= still_s]
        total = sum(duration_s(samples, r) for r in long)
        steps.append(Step(threshold, len(long), total))
    chosen = _plateau([step.poses for step in steps])
    return Stillness(activity, tuple(steps), chosen, tuple(found[chosen]))


def duration_s(samples: Samples, run: tuple[int, int]) -> float:
    """Length of a run in seconds, each sample standing for a step."""
    start, stop = run
    return float(samples.time_s[stop - 1] - samples.time_s[start]) + samples.step_s


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


def _activity(samples: Samples) -> FloatArray:
    window = max(WINDOW_MIN, math.ceil(WINDOW_S / samples.step_s))
    activity = _over_floor(_deviation(samples.reading, window))
    if samples.gyro is not None:
        activity = np.maximum(activity, _over_floor(_deviation(samples.gyro, window)))
    return activity


def _over_floor(deviation: FloatArray) -> FloatArray:
    floor = float(np.percentile(deviation, _FLOOR_PERCENTILE))
    if floor <= 0.0:  # readings that do not even flicker: the smallest that is seen stands in
        positive = deviation[deviation > 0.0]
        floor = float(np.percentile(positive, _FLOOR_PERCENTILE)) if len(positive) else 1.0
    result: FloatArray = deviation / floor
    return result


def _deviation(values: FloatArray, window: int) -> FloatArray:
    """Root of the summed variances within a centred window, shape (n,)."""
    n = len(values)
    centred = values - values.mean(axis=0)
    first = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(centred, axis=0)])
    second = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(centred**2, axis=0)])
    half = window // 2
    start = np.clip(np.arange(n) - half, 0, max(n - window, 0))
    stop = np.minimum(start + window, n)
    count = (stop - start)[:, None]
    mean = (first[stop] - first[start]) / count
    variance = np.maximum((second[stop] - second[start]) / count - mean**2, 0.0)
    result: FloatArray = np.sqrt(variance.sum(axis=1))
    return result


def _runs(samples: Samples, still: BoolArray) -> list[tuple[int, int]]:
    """Stretches of still samples, cut at gaps in time and where the section changes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    cuts = _cuts(samples)
    runs: list[tuple[int, int]] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        inner = [int(c) for c in cuts if start < c < stop]
        runs += list(pairwise([start, *inner, stop]))
    return runs


def _cuts(samples: Samples) -> IntArray:
    cuts = samples.gaps
    if samples.label is not None:
        labels = np.array(samples.label)
        cuts = np.union1d(cuts, np.flatnonzero(labels[1:] != labels[:-1]) + 1)
    return cuts
