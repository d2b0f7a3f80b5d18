"""Means of a recording over short windows, from one reading of it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import INCREMENT, ImuRecording
from triaxcal.model.types import BoolArray, FloatArray, IntArray

WINDOW_S = 0.1
GAP_INTERVALS = 1.75
"""A step of time longer than so many intervals is a gap."""
SATURATED_S = 0.25
"""A gyro that stays exactly at its largest value for so long has met its full scale."""
SATURATED_RAD_PER_S = np.radians(5.0)
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
    force_scatter : array, shape (w,)
        Standard deviation of the samples within the window, of the noisiest accelerometer, m/s^2.
    rate_peak, rate_next, rate_low : arrays, shape (w, 3)
        Largest absolute rate of a sample, the next smaller one, and the smallest, rad/s.
    at_peak, at_next : arrays, shape (w, 3)
        How many samples read the largest, and the next smaller one.
    section : array, shape (w,)
        Number of the section without a gap.
    """

    start_s: FloatArray
    duration_s: FloatArray
    first: IntArray
    rate: FloatArray
    force: FloatArray
    force_scatter: FloatArray
    rate_peak: FloatArray
    rate_next: FloatArray
    rate_low: FloatArray
    at_peak: IntArray
    at_next: IntArray
    section: IntArray

    def part(self, marked: BoolArray) -> Windows:
        """Those that are marked."""
        return Windows(**{f.name: getattr(self, f.name)[marked] for f in fields(self)})


def read_windows(recording: ImuRecording) -> tuple[Windows, list[tuple[int, int]]]:
    """Read a recording once.

    Returns
    -------
    windows : Windows
    sections : list of (first, last)
        Numbers of the samples of each section.

    Raises
    ------
    RefusedError
        When a gyro stands at its largest value as if it could read no more.
    """
    length = max(1, round(WINDOW_S * recording.rate_hz))
    interval = 1 / recording.rate_hz
    rows: list[tuple[Any, ...]] = []
    edges: list[tuple[int, int]] = [(0, -1)]
    previous_s, count = None, 0
    for chunk in recording.chunks(CHUNK // length * length):
        step = np.diff(chunk.time_s, prepend=chunk.time_s[0] - interval)
        if previous_s is not None:
            step[0] = chunk.time_s[0] - previous_s
        cuts = [0, *np.flatnonzero(step > GAP_INTERVALS * interval), len(chunk)]
        rate = _per_second(chunk.rate, step, recording.rate_convention)
        force = _per_second(chunk.force, step, recording.force_convention)
        _refuse_saturation(recording, chunk.time_s, chunk.rate, rate)
        # Steps of time differ in their last digits, and equal counts with them.
        read = np.abs(chunk.rate) / (interval if recording.rate_convention == INCREMENT else 1.0)
        for number, (a, b) in enumerate(pairwise(cuts)):
            if number > 0:
                edges[-1] = (edges[-1][0], count + int(a) - 1)
                edges.append((count + int(a), -1))
            begin = int(a) + (1 if number > 0 else 0)  # an increment over a gap is none
            starts = np.arange(begin, int(b), length)
            if len(starts) == 0:
                continue
            sizes = np.diff(starts, append=int(b))
            means = [np.add.reduceat(v[: int(b)], starts) / sizes[:, None] for v in (rate, force)]
            deviation = force[begin : int(b)] - np.repeat(means[1], sizes, axis=0)
            variance = np.add.reduceat(deviation**2, starts - begin) / sizes[:, None]
            section = np.full(len(starts), len(edges) - 1)
            at_s, duration_s = chunk.time_s[starts], sizes * interval
            scatter = np.sqrt(variance.max(axis=1))
            peaks = _peaks(read[begin : int(b)], starts - begin, sizes)
            rows.append((at_s, duration_s, count + starts, *means, scatter, *peaks, section))
        count += len(chunk)
        previous_s = float(chunk.time_s[-1])
    edges[-1] = (edges[-1][0], count - 1)
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return Windows(*columns), edges


def _peaks(
    size: FloatArray, starts: IntArray, sizes: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, IntArray]:
    """Largest value, the next and the smallest of each window, and how many are the first two."""
    peak, low = np.maximum.reduceat(size, starts), np.minimum.reduceat(size, starts)
    held = size == np.repeat(peak, sizes, axis=0)
    less = np.where(held, -1.0, size)
    following = np.maximum.reduceat(less, starts)
    second = less == np.repeat(following, sizes, axis=0)
    at_peak, at_next = (
        np.add.reduceat(marked.astype(np.int64), starts) for marked in (held, second & ~held)
    )
    return peak, following, low, at_peak, at_next


def _per_second(values: FloatArray, step_s: FloatArray, convention: str) -> FloatArray:
    return values / step_s[:, None] if convention == INCREMENT else values


def _refuse_saturation(
    recording: ImuRecording, time_s: FloatArray, raw: FloatArray, rate: FloatArray
) -> None:
    length = max(5, round(SATURATED_S * recording.rate_hz))
    for axis in range(3):
        size = np.abs(raw[:, axis])
        largest = float(size.max())
        flat = np.flatnonzero(size == largest)
        if len(flat) < length or abs(rate[flat[0], axis]) < SATURATED_RAD_PER_S:
            continue
        runs = np.split(flat, np.flatnonzero(np.diff(flat) != 1) + 1)
        run = max(runs, key=len)
        if len(run) >= length:
            raise RefusedError(
                f"{recording.name}, {time_s[run[0]]:.1f} s",
                f"gyro {'xyz'[axis]} reads exactly {np.degrees(rate[run[0], axis]):.4g} deg/s "
                f"{len(run)} times on end: it is saturated",
                expected="rates within the gyros' range",
                remedy="turn more slowly",
            )
