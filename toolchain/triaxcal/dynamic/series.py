"""One sensor of a log on its own even clock: beats without a reading are filled where they can be.

Times, readings and what the filled ones are uncertain by. Where a hole is too long to be filled,
the series has a gap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.lost import LONGEST_S, Hole, fill, holes, lagrange_weights
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.evenclock import EvenClock, even_clock
from triaxcal.readings.held import changed, moving

BRIDGED_SD_RAD = 0.02
"""A turn that is less certain over a hole spoils what is linear in it: the hole is a gap then."""
_AROUND = 128
"""Beats around a hole that are looked at."""
_POINTS = 4
_EARLY = 0.03
"""Part of the new values that are hardly late, where they are late by anything up to a row."""


@dataclass(frozen=True)
class Series:
    """Samples of one sensor.

    Attributes
    ----------
    time_s : array, shape (n,)
    beat : array, shape (n,)
        Of its clock: consecutive but for gaps.
    values : array, shape (n, columns)
    variance : array, shape (n, columns)
        Summed over the samples of a hole: variance of their sum beyond their noise.
    step_s : float
    lost : int
        Samples that were filled.
    places : int
        Holes that were filled.
    longest_s : float
        The longest hole that was filled.
    first_s : float
        Time before the first of them.
    worst : float
        Largest variance of the sum over one of them, of `turns`.
    gaps : tuple of (float, float)
        Time and length of what was not filled.
    """

    time_s: FloatArray
    beat: IntArray
    values: FloatArray
    variance: FloatArray
    step_s: float
    lost: int
    places: int
    longest_s: float
    first_s: float
    worst: float
    gaps: tuple[tuple[float, float], ...]


def series_of(clock: EvenClock, values: FloatArray, known: BoolArray, turns: slice) -> Series:
    """Series of rows (n, columns) with the times of `clock`.

    Parameters
    ----------
    known : array, shape (n,), bool
        Rows that have a reading.
    turns : slice
        Columns that are rates, rad/s: they bound the length of a hole. Empty where none is.
    """
    number, x = clock.number[known], values[known]
    found = holes(number, int(LONGEST_S / clock.step_s + 1e-9))
    made: list[tuple[int, Hole]] = []
    for first, count in found:
        place = int(np.searchsorted(number, first))
        near = slice(max(place - _AROUND, 0), place + _AROUND)
        hole = fill(number[near], x[near], first, count)
        if hole is None:
            continue
        turn = hole.variance[turns].max(initial=0.0)
        if clock.step_s * math.sqrt(float(turn)) <= BRIDGED_SD_RAD:
            made.append((first, hole))
    beats = [np.arange(first, first + len(hole.values)) for first, hole in made]
    beat = np.concatenate([number, *beats]).astype(np.int64)
    order = np.argsort(beat, kind="stable")
    all_values = np.concatenate([x, *(hole.values for _, hole in made)])
    spread = [np.repeat(h.variance[None] / len(h.values), len(h.values), axis=0) for _, h in made]
    variance = np.concatenate([np.zeros_like(x), *spread])
    time_s = np.interp(beat, clock.number, clock.time_s)[order]
    beat = beat[order]
    breaks = np.flatnonzero(np.diff(beat) > 1)
    lengths = [len(hole.values) for _, hole in made]
    return Series(
        time_s=time_s,
        beat=beat,
        values=all_values[order],
        variance=variance[order],
        step_s=clock.step_s,
        lost=sum(lengths),
        places=len(made),
        longest_s=max(lengths, default=0) * clock.step_s,
        first_s=float(np.interp(made[0][0] - 1, beat, time_s)) if made else 0.0,
        worst=max((float(h.variance[turns].max(initial=0.0)) for _, h in made), default=0.0),
        gaps=tuple(
            (float(time_s[k]), float(time_s[k + 1] - time_s[k] - clock.step_s)) for k in breaks
        ),
    )


def held_series(time_s: FloatArray, values: FloatArray, step_s: float, turns: slice) -> Series:
    """Series of a sensor whose values a faster log repeats; rows (n,) in order of time.

    A value is new in the first row that shows it. So rows are late by up to a row, and the least
    late ones are on the sensor's clock. At rest a value may be new and the same: where a beat has
    no new value, it is the one that the row of that time shows.
    """
    new = np.flatnonzero(changed(values))
    spans = np.diff(time_s[new])
    in_motion = moving(values)[new]
    tell = spans[in_motion[:-1] & in_motion[1:]]
    clock = even_clock(time_s[new], float(tell[tell < 3 * np.median(tell)].mean()))
    late = time_s[new] - clock.time_s
    early_s = float(np.quantile(late, _EARLY)) if clock.smoothed else 0.0
    every = np.arange(clock.number[-1] + 1)
    at = np.interp(every, clock.number, clock.time_s) + early_s
    row = np.searchsorted(time_s, at - 0.01 * step_s)
    row[clock.number] = new
    row = np.minimum(row, len(time_s) - 1)
    known = np.abs(time_s[row] - at) < clock.step_s
    whole = EvenClock(every, at, clock.step_s, clock.rms_s, clock.smoothed)
    return series_of(whole, values[row], known, turns)


def at_times(series: Series, time_s: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Readings (n, columns) and variances at other times, and the times (n,) that have them.

    By the cubic through four samples in a row: its phase is exact to the fourth order.
    """
    after = np.searchsorted(series.time_s, time_s, side="right")
    first = np.clip(after - _POINTS // 2, 0, max(len(series.time_s) - _POINTS, 0))
    index = first[:, None] + np.arange(_POINTS)
    beats = series.beat[index]
    in_row = beats[:, -1] - beats[:, 0] == _POINTS - 1
    start = series.time_s[first]
    x = (time_s - start) / ((series.time_s[first + _POINTS - 1] - start) / (_POINTS - 1))
    inside = in_row & (x >= -0.5) & (x <= _POINTS - 0.5)
    weights = lagrange_weights(np.arange(_POINTS), x)
    values = np.einsum("nj,njc->nc", weights, series.values[index])
    variance = np.einsum("nj,njc->nc", np.abs(weights), series.variance[index])
    return values, variance, inside
