"""Stamps of packets: rows that arrive together have one stamp, or stamps close to each other.

The stamp of a packet is that of its newest row; the rows before it are as many beats of an even
clock earlier. A clock whose ticks are coarser than the rows does the same.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.beats import consecutive
from triaxcal.readings.evenclock import EvenClock, smoothed

CLOSE = 0.1
"""Of the mean step: rows that follow so fast were not sampled so."""
SHARE = 0.4
"""Of the rows: fewer are late stamps, and no packets."""
PACKETS_MIN = 16
_REACH = 4
_SURELY = 6.0


def packet_clock(stamps_s: FloatArray, same: BoolArray) -> EvenClock | None:
    """Clock of rows (n,) in the order of the file, by the stamps of their packets; None if none.

    `same`: rows with the readings of the row before: where most of the close ones are, rows are
    doubled.
    """
    count = len(stamps_s)
    steps = np.diff(stamps_s)
    mean_s = float(stamps_s[-1] - stamps_s[0]) / (count - 1)
    if mean_s <= 0 or (steps < 0).any():
        return None
    close = steps < CLOSE * mean_s
    newest = np.flatnonzero(~close)  # the last packet may lack its newest rows
    if (close & ~same[1:]).mean() < SHARE or len(newest) < PACKETS_MIN:
        return None
    at = stamps_s[newest]
    span = len(newest) // 4
    step_s = float(np.median((at[span:] - at[:-span]) / (newest[span:] - newest[:-span])))
    late = at / step_s - newest
    middle = median_filter(late, 2 * _REACH + 1, mode="mirror")
    low, high = np.quantile(late - middle, [0.16, 0.84])
    limit = max(0.5, _SURELY * (high - low) / 2 / np.sqrt(_REACH))
    lost = np.zeros(count, dtype=np.int64)
    before, after = middle[: -2 * _REACH - 1], middle[2 * _REACH + 1 :]
    stays = np.flatnonzero(after - before > limit)
    for run in consecutive(stays):
        packets = run + _REACH + 1
        jump = late[packets] - late[packets - 1]
        packet = int(packets[int(np.argmax(jump))])
        lost[newest[packet - 1] + 1] = int(np.rint((after - before)[run].max()))
    number = np.arange(count) + np.cumsum(lost)
    time_s, residual = smoothed(at, number[newest], step_s)
    first = np.polynomial.Polynomial.fit(number[newest[:2]], time_s[:2], 1)
    times = np.interp(number, number[newest], time_s)
    times = np.where(number < number[newest[0]], first(number), times)
    last = np.polynomial.Polynomial.fit(number[newest[-2:]], time_s[-2:], 1)
    times = np.where(number > number[newest[-1]], last(number), times)
    step_s = float(np.median(np.diff(times) / np.diff(number)))
    return EvenClock(number, times, step_s, float(np.sqrt(np.mean(residual**2))), smoothed=True)
