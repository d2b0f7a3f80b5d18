"""The even clock behind the stamps of a log: samples are taken evenly, stamps are late or rounded.

A sensor samples by an oscillator; what writes the stamp is a computer, and is late by as much as it
had other things to do. So the stamps t of the rows are numbered by the beats of an even clock, and

    t = offset + step * number + drift + jitter

is fitted robustly: `offset`, `step` and a slow drift of the rate. Rows that are absent leave beats
without a row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.beats import CLEAN, PAUSE_S, REACH, SPAN, consecutive, numbered

EXACT = 1e-3
"""Of a step: stamps that are nearer to the even clock than this stay as they are."""
_ROUNDS = 5
_BIN = 200
_ORDER_MAX = 5
_FASTEST = 0.9
"""Quantile of the change of the readings, above which they show when they were taken."""
_BETTER = 0.8
"""Of the squares that are missed: both times miss by noise where nothing moves."""
_EXACT_S = 1e-9
"""Stamps have no more digits."""
_FAR = 4.0
"""Stamps that are later by so many deviations do not count."""
_RESTART = 0.05
"""Of a step: a clock that is off by less may as well drift."""
_SURELY = 10.0
"""Deviations of a median of `REACH` stamps that are no chance in millions of rows."""
_RESTARTS_MAX = 0.05
_SAME = 0.01
"""Of a step: rounded steps are nearer than this to each other, or a tick apart."""
_FEW = 6
_ROUNDED = 0.75
"""Of a tick: what rounding and a slow curve leave."""
_LAGS = (16, 64)
"""Rows over which differences are taken, to see what adds up."""
_STEADY = 2e-3
"""Of the jitter's variance: steps that add up to less over 500 rows are seen by the slow curve."""
_LOOSE = 4.0
"""Mean square of the bins' means about a curve over that of their noise, where it is enough:
what is less than two deviations of a bin is not worth more bends."""


@dataclass(frozen=True)
class EvenClock:
    """Numbered rows.

    Attributes
    ----------
    number : array, shape (n,)
        Beats since the first row, rising.
    time_s : array, shape (n,)
        Time of each row: its stamp, or that of the even clock where `smoothed`.
    step_s : float
    rms_s : float
        Of the stamps about the even clock.
    smoothed : bool
    """

    number: IntArray
    time_s: FloatArray
    step_s: float
    rms_s: float
    smoothed: bool

    @property
    def lost(self) -> int:
        """Beats without a row."""
        return int(self.number[-1]) + 1 - len(self.number)


def even_clock(stamps_s: FloatArray, step_s: float) -> EvenClock:
    """Number rising stamps, shape (n,) with n > 1, of a clock of about `step_s`."""
    number = numbered(stamps_s, step_s)
    for _ in range(_ROUNDS):  # lost rows that are not yet found make the step too long
        last = number
        step_s = float(stamps_s[-1] - stamps_s[0]) / float(number[-1])
        number = numbered(stamps_s, step_s)
        if number[-1] == last[-1]:
            break
    time_s, residual_s = smoothed(stamps_s, number, step_s)
    rms_s = float(np.sqrt(np.mean(residual_s**2)))
    step_s = float(np.median(np.diff(time_s) / np.diff(number)))
    if rms_s < EXACT * step_s:
        return EvenClock(number, stamps_s, step_s, rms_s, False)
    return EvenClock(number, time_s, step_s, rms_s, True)


def taken_at_stamps(stamps_s: FloatArray, clock: EvenClock, values: FloatArray) -> bool:
    """Whether the readings (n, columns) say that the stamps are right and the samples uneven.

    Each reading is predicted by the cubic through the four around it, once at the stamps and once
    at even times. Where the readings change fastest, the wrong times miss by more.
    """
    if not clock.smoothed:
        return False
    index = np.flatnonzero(clock.number[4:] - clock.number[:-4] == 4) + 2
    close = np.diff(stamps_s) < CLEAN * clock.step_s
    index = index[~(close[index - 2] | close[index - 1] | close[index] | close[index + 1])]
    if len(index) == 0:
        return False
    change = np.abs(values[index + 1] - values[index - 1]).max(axis=1)
    index = index[change >= np.quantile(change, _FASTEST)]
    around = index[:, None] + np.array([-2, -1, 1, 2])
    missed = []
    for time_s in (stamps_s, clock.time_s):
        x = (time_s[around] - time_s[index][:, None]) / clock.step_s
        weights = np.ones_like(x)
        for j in range(4):
            for k in range(4):
                if k != j:
                    weights[:, j] *= -x[:, k] / (x[:, j] - x[:, k])
        miss = np.einsum("nj,njc->nc", weights, values[around]) - values[index]
        missed.append(float(np.median((miss**2).sum(axis=1))))
    return missed[0] < _BETTER * missed[1]


def smoothed(
    stamps_s: FloatArray, number: IntArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Times of the even clock, and what the stamps are off, of each part without a long pause."""
    time_s, residual = np.empty(len(stamps_s)), np.empty(len(stamps_s))
    pauses = np.flatnonzero(np.diff(number) * step_s > PAUSE_S) + 1
    starts = np.union1d(pauses, _restarts(stamps_s, number, step_s))
    for part in np.split(np.arange(len(stamps_s)), starts):
        beat = (number[part] - number[part[0]]).astype(np.float64)
        since = stamps_s[part] - stamps_s[part[0]]
        own_s = float(since[-1] / beat[-1]) if beat[-1] >= SPAN else step_s
        late = since - own_s * beat
        drift = _curve(beat, late)
        if np.abs(late - drift).max() > _ROUNDED * _tick_s(stamps_s[part]):
            drift = drift + _wandering(late - drift)
        time_s[part] = stamps_s[part[0]] + own_s * beat + drift
        residual[part] = late - drift
    return time_s, residual


def _tick_s(stamps_s: FloatArray) -> float:
    """Smallest difference of two steps: what rounded stamps are rounded to."""
    steps = np.sort(np.diff(stamps_s))
    if len(steps) < _FEW:
        return 0.0
    ends = np.flatnonzero(np.diff(steps) > _SAME * steps[len(steps) // 2])
    if not 0 < len(ends) < _FEW:
        return 0.0
    middles = [float(np.median(part)) for part in np.split(steps, ends + 1)]
    return float(np.diff(middles).min())


def _wandering(left: FloatArray) -> FloatArray:
    """What of the rest (n,) about a slow curve is no jitter: the samples themselves are uneven.

    Of white jitter of variance r and steps of variance q that add up, differences over m rows have
    the variance m q + 2 r. Jitter of rows that were sorted, or rounding, is not white, but does not
    add up either.
    """
    if len(left) < 4 * _LAGS[-1]:
        return np.zeros(len(left))
    one, some, many = (_mean_square(left[lag:] - left[:-lag]) for lag in (1, *_LAGS))
    wander = max(many - some, 0.0) / (_LAGS[1] - _LAGS[0])
    jitter = max(one - wander, 0.0) / 2
    if wander <= _STEADY * jitter:
        return np.zeros(len(left))
    if wander >= jitter / 4:
        return left
    return np.asarray(uniform_filter1d(left, 2 * round(np.sqrt(jitter / wander)) + 1))


def _mean_square(values: FloatArray) -> float:
    return float(np.mean(values[_near(values)] ** 2))


def _restarts(stamps_s: FloatArray, number: IntArray, step_s: float) -> IntArray:
    """Rows (m,) from which on the stamps stay off by a part of a step: the clock started anew."""
    late = stamps_s / step_s - number
    if len(late) < 4 * REACH:
        return np.zeros(0, dtype=np.int64)
    middle = median_filter(late, 2 * REACH + 1, mode="mirror")
    stays = np.zeros(len(late))
    stays[REACH + 1 : -REACH] = middle[2 * REACH + 1 :] - middle[: -2 * REACH - 1]
    low, high = np.quantile(late - middle, [0.16, 0.84])
    limit = max(_RESTART, _SURELY * (high - low) / 2 / np.sqrt(REACH))
    rows = np.flatnonzero(np.abs(stays) > limit)
    if len(rows) > _RESTARTS_MAX * len(late):
        return np.zeros(0, dtype=np.int64)  # it drifts all the time
    step = np.abs(np.diff(late, prepend=late[0]))
    largest = [run[int(np.argmax(step[run]))] for run in consecutive(rows)]
    return np.array(largest, dtype=np.int64)


def _curve(beat: FloatArray, late: FloatArray) -> FloatArray:
    """Slow curve through `late`, shape (n,): a line, or as much more as the drift of a rate needs.

    Through means of bins, without the stamps that are far from the others.
    """
    bins = max(1, min(len(beat) // _BIN, 400))
    if len(beat) < 8 or bins < 2:
        return np.full(len(beat), np.median(late)) if len(beat) < 8 else _line(beat, late)
    parts = np.array_split(np.arange(len(beat)), bins)
    means = [_clipped_mean(late[part]) for part in parts]
    x = np.array([beat[part].mean() for part in parts])
    y = np.array([mean for mean, _ in means])
    sd = float(np.median([sd for _, sd in means]))
    scale = max(float(beat[-1]), 1.0)
    for order in range(1, min(_ORDER_MAX, bins - 2) + 1):
        fitted = np.polynomial.Polynomial.fit(x / scale, y, order)
        left = y - fitted(x / scale)
        if float(left @ left) <= _LOOSE * max(sd, _EXACT_S) ** 2 * (bins - order - 1):
            return np.asarray(fitted(beat / scale))
    if bins <= 3:
        return _line(beat, late)
    first, last = (np.polynomial.Polynomial.fit(x[k], y[k], 1) for k in ([0, 1], [-2, -1]))
    curve = np.interp(beat, x, y)
    curve = np.where(beat < x[0], first(beat), curve)
    return np.where(beat > x[-1], last(beat), curve)


def _clipped_mean(values: FloatArray) -> tuple[float, float]:
    """Mean without what is far from the median, and its standard deviation."""
    kept = values[_near(values)]
    return float(kept.mean()), float(kept.std() / np.sqrt(len(kept)))


def _near(values: FloatArray) -> BoolArray:
    """Values that are not far from the median, by the width of the middle two thirds."""
    low, middle, high = np.quantile(values, [0.16, 0.5, 0.84])
    near: BoolArray = np.abs(values - middle) <= _FAR * (high - low) / 2 + _EXACT_S
    return near


def _line(beat: FloatArray, late: FloatArray) -> FloatArray:
    """Robust line: twice without what is far from it."""
    keep = np.ones(len(beat), dtype=bool)
    line = np.polynomial.Polynomial([0.0])
    for _ in range(3):
        line = np.polynomial.Polynomial.fit(beat[keep], late[keep], 1)
        keep = _near(late - line(beat))
    return np.asarray(line(beat))
