"""Beats of jittered stamps by the phase of their clock, which lost rows do not move.

A stamp is a whole number of steps and a jitter. So exp(2 pi i t / step) has the same phase for all
rows, however many were lost between them; its mean over some hundred rows is the phase of the
clock, and its size shows the jitter. What is left of each stamp about this phase is a whole number
and jitter, and the most likely rising numbers are found for all rows at once (Viterbi, IEEE
Transactions on Information Theory 13, 1967).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from triaxcal.model.types import FloatArray, IntArray

WINDOWS = (256, 1024, 4096)
"""Rows of which a mean phase is taken: the shortest that show it, because a clock may drift."""
_LEAST = 4
"""Windows."""
_SEEN = 3.0
"""Times the size that chance gives a mean of n unit vectors, 1 / sqrt(n): a phase is seen."""
_TRIED = 32
"""Windows that the step is searched in."""
_RANGE = 0.05
"""Of the step: how far about it is searched."""
_TURN = 0.25
"""Of a turn: a larger change of phase from window to window is not followed."""
_STATES = 4
"""Beats on each side of the middle row that a stamp may stand for."""
_LOST = 5.0
"""Cost of a lost row, as a chi-square over two: once in 150 rows."""
_FAR = 6.0
"""Most that a single stamp counts, in the same measure."""
_LEAST_SD = 0.05


def beats_by_phase(stamps_s: FloatArray, step_s: float) -> IntArray | None:
    """Beats since the first row, shape (n,), of rising stamps; None where no phase is seen."""
    for window in WINDOWS:
        if len(stamps_s) < _LEAST * window:
            return None
        found = _turns(stamps_s, step_s, window)
        if found is not None:
            return _numbers(*found)
    return None


def _turns(stamps_s: FloatArray, step_s: float, window: int) -> tuple[FloatArray, float] | None:
    """Stamps in steps, shape (n,): whole numbers but for jitter. And the jitter; None if unseen."""
    parts = np.array_split(stamps_s, len(stamps_s) // window)
    few = parts[:: max(1, len(parts) // _TRIED)]
    tried = step_s * np.linspace(1 - _RANGE, 1 + _RANGE, round(8 * _RANGE * window) + 1)
    sizes = [sum(abs(_mean(part, step)) for part in few) for step in tried]
    best = float(tried[int(np.argmax(sizes))])
    means = np.array([_mean(part, best) for part in parts])
    size = float(np.median(np.abs(means)))
    if size < _SEEN / np.sqrt(window):
        return None
    middle_s = np.array([part.mean() for part in parts])
    phase = np.angle(means) / (2 * np.pi)
    change = np.diff(phase)
    change -= np.rint(change)
    slope = float(np.median(change / np.diff(middle_s)))
    left = change - slope * np.diff(middle_s)
    left -= np.rint(left)
    if np.quantile(np.abs(left), 0.95) > _TURN:
        return None
    drift = phase[0] + np.r_[0.0, np.cumsum(left)]
    at = np.interp(stamps_s, middle_s, drift) + slope * (stamps_s - middle_s[0])
    turns = (stamps_s - stamps_s[0]) / best + stamps_s[0] / best - at
    # Of normal jitter the mean is exp(-2 pi^2 sd^2).
    sd = float(np.sqrt(-np.log(min(size, 1.0)) / 2)) / np.pi
    return turns - np.floor(turns[0]), max(sd, _LEAST_SD)


def _mean(stamps_s: FloatArray, step_s: float) -> complex:
    return complex(np.exp(2j * np.pi * (stamps_s / step_s)).mean())


def _numbers(turns: FloatArray, sd: float) -> IntArray:
    """The most likely rising whole numbers (n,) for `turns` with jitter `sd`."""
    count, width = len(turns), 2 * _STATES + 1
    row = np.arange(count)
    middle = median_filter(turns - row, 4 * _STATES + 1, mode="nearest")
    base = np.maximum.accumulate(np.rint(middle).astype(np.int64)) + row - _STATES
    offset = np.arange(width)
    miss = turns[:, None] - base[:, None] - offset
    cost = np.minimum((miss / sd) ** 2 / 2, _FAR)
    came = np.empty((count, width), dtype=np.int8)
    total = cost[0]
    for k in range(1, count):
        ahead = int(base[k] - base[k - 1])
        # From state j at the row before to state s: s + ahead - j beats, one at least.
        lost = offset + ahead - offset[:, None] - 1
        way = np.where(lost >= 0, total[:, None] + _LOST * lost, np.inf)
        came[k] = way.argmin(axis=0)
        total = way.min(axis=0) + cost[k]
    state = np.empty(count, dtype=np.int64)
    state[-1] = int(total.argmin())
    for k in range(count - 1, 0, -1):
        state[k - 1] = came[k, state[k]]
    number = base + state
    return np.asarray(number - number[0])
