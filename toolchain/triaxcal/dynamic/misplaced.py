"""Holes of a log with jittered stamps, put where the readings say.

Stamps that scatter by a third of a step leave it open behind which of a few rows one was lost. The
readings of a unit that turns do not: put at a wrong place, they are off a smooth curve by what a
step changes. So each hole is tried behind the rows about it, and the readings, as a polynomial of
time with noise of unknown size, and the stamps have their likelihoods multiplied. At rest the
stamps alone decide, and nothing depends on it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.dynamic.lost import LONGEST_S
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.evenclock import EvenClock

UNSURE = 0.05
"""Of a step: stamps that scatter by less tell the place."""
SHIFT = 8
"""Rows on each side that a hole is tried behind."""
NEAR = 9
"""Rows on each side of it that the polynomial goes through."""
ORDER = 5
_ROUNDS = 2
"""Holes that are close to each other are moved in turn."""


def settled(clock: EvenClock, stamps_s: FloatArray, values: FloatArray) -> EvenClock:
    """The same clock, with the beats of rows about holes as the readings (n, columns) say."""
    sd = clock.rms_s / clock.step_s
    if not clock.smoothed or sd < UNSURE:
        return clock
    number = clock.number.copy()
    late = (stamps_s - clock.time_s) / clock.step_s + number  # beat by the stamp
    longest = LONGEST_S / clock.step_s
    for _ in range(_ROUNDS):
        before = number.copy()
        for k in np.flatnonzero(np.diff(number) > 1).tolist():
            lost = int(number[k + 1] - number[k]) - 1
            if lost and lost <= longest:
                _settle(number, k, (late, values), sd)
        if np.array_equal(before, number):
            break
    time_s = np.interp(number, clock.number, clock.time_s)
    return replace(clock, number=number, time_s=time_s)


def _settle(number: IntArray, k: int, read: tuple[FloatArray, FloatArray], sd: float) -> None:
    """Move the hole behind row k to where it is most likely, in place."""
    late, values = read
    lost = int(number[k + 1] - number[k]) - 1
    best, chosen = np.inf, number[:0]
    first, last = max(k - SHIFT - NEAR, 0), min(k + SHIFT + NEAR + 1, len(number))
    own, x = number[first:last], values[first:last]
    floor = 1e-9 * x.var(axis=0) + 1e-30
    for row in range(max(k - SHIFT, first), min(k + SHIFT, last - 2) + 1):
        beat = own.copy()
        beat[row + 1 - first : k + 1 - first] += lost
        beat[k + 1 - first : row + 1 - first] -= lost
        if (np.diff(beat) < 1).any():
            continue  # beyond another hole
        left = _left(beat, x) + floor
        cost = (len(own) - ORDER - 1) * float(np.log(left).sum())
        cost += float((np.minimum(np.abs(late[first:last] - beat) / sd, 4.0) ** 2).sum())
        if cost < best:
            best, chosen = cost, beat
    if len(chosen) > 2 * ORDER:
        number[first:last] = chosen


def _left(beat: IntArray, values: FloatArray) -> FloatArray:
    """Mean squares (columns,) about polynomials of the beats (n,) through values (n, columns)."""
    t = (beat - beat[0]) / (beat[-1] - beat[0]) * 2.0 - 1.0
    q = np.linalg.qr(np.polynomial.legendre.legvander(t, ORDER))[0]
    return np.asarray(((values - q @ (q.T @ values)) ** 2).mean(axis=0))
