"""Half-cycles of a temperature that rises and falls, and what differs between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.readings.samples import TEMP, Samples
from triaxcal.readings.table import TIME

SMOOTH_S = 60.0
"""Window of the temperature's slope: units warm over minutes, thermometers jitter by tenths."""
TURN_DEGC = 5.0
"""A half-cycle goes at least so far."""
_SAMPLES_MIN = 64


@dataclass(frozen=True)
class HalfCycle:
    """A stretch of rising or falling temperature: samples start to stop, stop excluded."""

    start: int
    stop: int
    rising: bool

    def label(self, temp_degc: FloatArray) -> str:
        """Words for tables."""
        first, last = temp_degc[self.start], temp_degc[self.stop - 1]
        return f"{'heating' if self.rising else 'cooling'} {first:.0f} to {last:.0f} degC"


def smoothed(samples: Samples) -> tuple[FloatArray, FloatArray]:
    """Temperature and its slope, each (n,), by a straight line in a centred window.

    Raises
    ------
    RefusedError
        When there are too few samples for a slope.
    """
    if len(samples) < _SAMPLES_MIN:
        raise RefusedError(
            samples.source,
            f"{len(samples)} sample{'s' * (len(samples) != 1)}",
            expected=f"{_SAMPLES_MIN} at least",
            remedy="record longer",
        )
    t, temp = samples.part(TIME), samples.part(TEMP)
    half = max(2, round(SMOOTH_S / samples.step_s / 2.0))
    n = len(t)
    low, high = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half + 1, n)
    sums = [np.concatenate([[0.0], np.cumsum(v)]) for v in (t, temp, t * t, t * temp)]
    st, sy, stt, sty = (s[high] - s[low] for s in sums)
    count = high - low
    rate = (sty - st * sy / count) / (stt - st * st / count)
    middle = sy / count + rate * (t - st / count)
    return middle, rate


def half_cycles(temp: FloatArray) -> tuple[HalfCycle, ...]:
    """Stretches between turning points at least `TURN_DEGC` apart."""
    turns = [0]
    extreme, rising = 0, None
    for k in range(1, len(temp)):
        if rising is None:
            if abs(temp[k] - temp[0]) >= TURN_DEGC:
                rising, extreme = bool(temp[k] > temp[0]), k
            continue
        if (temp[k] > temp[extreme]) == rising:
            extreme = k
        elif abs(temp[k] - temp[extreme]) >= TURN_DEGC:
            turns.append(extreme)
            rising, extreme = not rising, k
    if rising is None:
        return ()
    ends = [*turns, len(temp)]
    return tuple(HalfCycle(a, b, bool(temp[b - 1] > temp[a])) for a, b in pairwise(ends))


@dataclass(frozen=True)
class Apart:
    """Heating less cooling, degree by degree.

    Attributes
    ----------
    degc : array, shape (m,)
        Middle of each degree in which both were recorded.
    difference, sd : arrays, shape (m, 3)
        Of the means, reading units; `sd` by the scatter within the degree.
    count : array, shape (m, 2)
        Samples while heating and cooling.
    """

    degc: FloatArray
    difference: FloatArray
    sd: FloatArray
    count: FloatArray


def heating_less_cooling(
    reading: FloatArray, temp: FloatArray, halves: tuple[HalfCycle, ...]
) -> Apart:
    """Differences of the two at one temperature.

    The mean temperatures of the two differ within a degree; what the slope of the curve makes of
    that is taken off.
    """
    degree = np.floor(temp).astype(np.int64)
    rising = np.zeros(len(temp), dtype=np.bool_)
    for half in halves:
        rising[half.start : half.stop] = half.rising
    both = np.intersect1d(degree[rising], degree[~rising])
    means, temps, counts, variances = [], [], [], []
    for part in (rising, ~rising):
        index = np.searchsorted(both, degree[part])
        inside = (index < len(both)) & np.isin(degree[part], both)
        index, values = index[inside], reading[part][inside]
        count = np.bincount(index, minlength=len(both)).astype(np.float64)
        sums = [np.bincount(index, weights=v, minlength=len(both)) for v in values.T]
        mean = np.stack(sums, axis=1) / count[:, None]
        away = (values - mean[index]) ** 2
        squares = [np.bincount(index, weights=v, minlength=len(both)) for v in away.T]
        means.append(mean)
        temps.append(np.bincount(index, weights=temp[part][inside], minlength=len(both)) / count)
        counts.append(count)
        variances.append(np.stack(squares, axis=1) / np.maximum(count - 1.0, 1.0)[:, None])
    difference = means[0] - means[1]
    if len(both) > 1:
        middle = 0.5 * (temps[0] + temps[1])
        slope = np.gradient(0.5 * (means[0] + means[1]), middle, axis=0)
        difference = difference - slope * (temps[0] - temps[1])[:, None]
        # Within a degree the slope of the curve scatters the readings as well: no noise.
        variances = [np.maximum(v - slope**2 / 12.0, 0.1 * v) for v in variances]
    sd = np.sqrt(sum(v / n[:, None] for v, n in zip(variances, counts, strict=True)))
    degc = both.astype(np.float64) + 0.5
    return Apart(degc, difference, np.asarray(sd), np.stack(counts, axis=1))


def hysteresis(
    reading: FloatArray, temp: FloatArray, halves: tuple[HalfCycle, ...]
) -> tuple[FloatArray, FloatArray]:
    """Largest difference of heating and cooling in one degree, (3,), and at which, (3,)."""
    apart = heating_less_cooling(reading, temp, halves)
    if not len(apart.degc):
        return np.zeros(3), np.zeros(3)
    size = np.abs(apart.difference)
    return size.max(axis=0), apart.degc[size.argmax(axis=0)]
