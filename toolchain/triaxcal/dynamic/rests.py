"""Where the unit rests: its rate is the gyros' bias, and its force neither jumps nor turns.

A rest is found by what the sensors read, whatever holds the unit: a hand, a bench, a table that
stops. The noise is that of the quietest seconds of the recording, and the bias is the rate on which
most of the quiet stretches agree. How much of a rest's edges is spoiled by what came before or
comes after is seen in the force and the rate there, pooled over all rests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.windows import WINDOW_S, Windows
from triaxcal.model.types import BoolArray, FloatArray, IntArray

STILL_RAD_PER_S = np.radians(0.25)
"""Change of the rate, against the bias, that is no noise any more."""
STILL_MAX_RAD_PER_S = np.radians(3.0)
"""A noisy gyro is given so many deviations of a window's mean, up to this."""
STILL_SD = 5.0
"""A window at rest is beyond so many deviations once in two million."""
HAND_SHARE, HAND_TIMES = 0.9, 2.0
"""A hand that holds the unit stays below a rate for so much of the time, and below twice it."""
REST_MAX_RAD_PER_S = np.radians(25.0)
"""Data sheets of the coarsest gyros allow 20 deg/s at rest: what reads more turns."""
JUMP_M_PER_S2 = 0.05
"""Change of the force from a window to the next that a hand at rest may make: 0.3 deg of tilt."""
SHAKEN = 6.0
"""Samples that scatter within a window by so many times the quietest seconds' are shaken."""
SHAKEN_M_PER_S2 = 0.1
QUIET_S = 1.0
"""In a stretch so long an even turn differs from a bias."""
QUIETEST = 0.1
"""Part of all seconds that is surely at rest, to know the noise by."""
REST_MIN_S = 0.5
"""Shortest rest that is used, without its guards."""
GUARD_MIN_S = 0.2
"""A slow start hides in the noise of one window; in so many of every edge it would add up."""
GUARD_MAX_S = 2.0
"""A table that is loaded by hand starts and ends slowly."""
SETTLED = 3
GUARD_PART = 0.25
"""Of a usual rest, that the guard on each side takes at most."""


Edges = tuple[int, int, bool, bool]
"""First window of a rest, the one after its last, and whether each edge meets a motion."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a window's mean, of the noisiest axis, at rest.

    Attributes
    ----------
    rate, force : float
        rad/s, m/s^2.
    force_scatter : float
        Of the samples within a window, m/s^2.
    """

    rate: float
    force: float
    force_scatter: float


@dataclass(frozen=True)
class Quiet:
    """What is known of each window before anything is called a stage.

    Attributes
    ----------
    still : array, shape (w,), bool
        The gyros read their bias.
    calm : array, shape (w,), bool
        The gyros read no more than in the hand that holds the unit, and the force neither jumps
        nor shakes.
    bias : array, shape (w, 3)
        Of the gyros, rad/s: of the rests before and after, in between by time.
    limit : float
        Rate against the bias that is no noise any more, rad/s.
    noise : Noise
    """

    still: BoolArray
    calm: BoolArray
    bias: FloatArray
    limit: float
    noise: Noise


def runs_of(marked: BoolArray, section: IntArray) -> list[tuple[int, int]]:
    """First window and the one after the last of each run of marked windows of one section."""
    if len(marked) == 0:
        return []
    new = np.r_[True, (np.diff(marked.astype(np.int8)) != 0) | (np.diff(section) != 0)]
    starts = np.flatnonzero(new)
    ends = np.r_[starts[1:], len(marked)]
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if marked[a]]


def quiet_windows(windows: Windows, starts_s: tuple[float, ...] = ()) -> Quiet | None:
    """Windows at rest; None if there is no stretch of `QUIET_S` in which nothing moves.

    `starts_s` are the times at which further recordings start: each has a bias of its own.
    """
    noise = _noise(windows)
    steady = _steady_force(windows, noise)
    limit = float(np.clip(STILL_SD * noise.rate, STILL_RAD_PER_S, STILL_MAX_RAD_PER_S))
    bias = np.zeros_like(windows.rate)
    recording = np.searchsorted(starts_s, windows.start_s, side="right")
    for number in np.unique(recording):
        own, held = None, limit
        inside = recording == number
        while own is None and held <= STILL_MAX_RAD_PER_S:
            own = _bias(windows.part(inside), steady[inside], held, noise)
            held *= 2
        if own is None:
            return None
        bias[inside] = own
    rate = np.abs(windows.rate - bias).max(axis=1)
    usual = rate[steady & (rate < STILL_MAX_RAD_PER_S)]
    shaking = HAND_TIMES * float(np.quantile(usual, HAND_SHARE)) if len(usual) else 0.0
    calm = steady & (rate < np.clip(shaking, limit, STILL_MAX_RAD_PER_S))
    return Quiet(rate < limit, calm, bias, limit, noise)


def even_in_runs(windows: Windows, quiet: Quiet) -> BoolArray:
    """Calm windows, shape (w,), whose rate is that of their run, which need not be the bias.

    A unit whose bias changed rests as well.
    """
    even = quiet.calm.copy()
    for a, b in runs_of(quiet.calm, windows.section):
        rate = windows.rate[a:b]
        even[a:b] = np.abs(rate - np.median(rate, axis=0)).max(axis=1) < quiet.limit
    return even


def _noise(windows: Windows) -> Noise:
    """Of the quietest seconds, by differences of windows that follow each other."""
    length = round(QUIET_S / WINDOW_S)
    found = []
    for values in (windows.rate, windows.force):
        change = np.diff(values, axis=0)[np.diff(windows.section) == 0]
        if len(change) < length:
            found.append(0.0)
            continue
        squares = np.cumsum(np.vstack([np.zeros(3), change**2 / 2]), axis=0)
        seconds = (squares[length:] - squares[:-length]) / length
        found.append(float(np.sqrt(np.quantile(seconds.max(axis=1), QUIETEST))))
    return Noise(found[0], found[1], float(np.quantile(windows.force_scatter, QUIETEST)))


def _steady_force(windows: Windows, noise: Noise) -> BoolArray:
    """Windows whose force does not jump from the one before or to the next, and is not shaken."""
    limit = max(JUMP_M_PER_S2, STILL_SD * 2**0.5 * noise.force)
    same = np.diff(windows.section) == 0
    jumps = (np.abs(np.diff(windows.force, axis=0)).max(axis=1) > limit) & same
    shaken = windows.force_scatter > max(SHAKEN_M_PER_S2, SHAKEN * noise.force_scatter)
    calm: BoolArray = ~(np.r_[False, jumps] | np.r_[jumps, False] | shaken)
    return calm


def _bias(windows: Windows, steady: BoolArray, limit: float, noise: Noise) -> FloatArray | None:
    """Bias (w, 3), rad/s, by the stretches in which neither rate nor force changes.

    An even turn about a level axis turns the force. One about the vertical does not, but its rate
    is shared by few stretches; the bias is the rate of most of them.
    """
    follows = np.diff(windows.section) == 0
    changes = (np.abs(np.diff(windows.rate, axis=0)).max(axis=1) > limit) & follows
    constant = steady & ~(np.r_[False, changes] | np.r_[changes, False])
    length = round(QUIET_S / WINDOW_S)
    leans = STILL_SD * 2**0.5 * noise.force
    means, middles = [], []
    for a, b in runs_of(constant, windows.section):
        if b - a < length:
            continue
        rate, force = windows.rate[a:b], windows.force[a:b]
        mean = np.median(rate, axis=0)
        far = np.linalg.norm(force[length - 1 :] - force[: b - a - length + 1], axis=1)
        turns = np.linalg.norm(force, axis=1).mean() * limit * QUIET_S
        if np.linalg.norm(mean) > REST_MAX_RAD_PER_S or np.median(far) > turns + leans:
            continue
        means.append(mean)
        middles.append((a + b) / 2)
    if not means:
        return None
    rates, at = np.array(means), np.array(middles)
    near = np.abs(rates[:, None] - rates[None]).max(axis=2) < limit
    votes = near.sum(axis=1)
    first = int(np.flatnonzero(votes == votes.max())[0])
    agreed = _neighbours(rates, near[first], limit)
    number = np.arange(len(windows.first))
    columns = [np.interp(number, at[agreed], rates[agreed, axis]) for axis in range(3)]
    return np.column_stack(columns)


def _neighbours(rates: FloatArray, agreed: BoolArray, limit: float) -> BoolArray:
    """Stretches whose rate is that of a neighbour that rests: a bias may drift through an hour."""
    agreed = agreed.copy()
    order = [*range(1, len(rates)), *range(len(rates) - 2, -1, -1)]
    steps = [*np.ones(len(rates) - 1, dtype=int), *-np.ones(len(rates) - 1, dtype=int)]
    for k, step in zip(order, steps, strict=True):
        before = k - step
        if agreed[before] and np.abs(rates[k] - rates[before]).max() < limit:
            agreed[k] = True
    return agreed


def guard_of(windows: Windows, rests: list[Edges]) -> int:
    """Windows at the edge of a rest that are not used.

    The smallest number after which `SETTLED` windows in a row are as quiet as the middles, by the
    median over the edges that meet a motion.
    """
    usual = np.median([b - a for a, b, *_ in rests]) if rests else 0
    least = round(GUARD_MIN_S / WINDOW_S)
    most = max(least, min(round(GUARD_MAX_S / WINDOW_S), int(usual * GUARD_PART)))
    edges = []
    for a, b, *counts in rests:
        edges += [_edge(windows, a, b, most, at_end) for at_end in (0, 1) if counts[at_end]]
    if not edges:
        return least
    pooled = np.nanmedian(np.array(edges), axis=0)  # (distance from the edge, size and change)
    limit = _usual_deviation(windows, rests) * (1 + 3 / np.sqrt(len(edges)))
    loud = (pooled > limit).any(axis=1)
    settled = [k for k in range(least, most) if not loud[k : k + SETTLED].any()]
    return settled[0] if settled else most


def _deviations(windows: Windows, a: int, b: int) -> FloatArray:
    """How loud each window of a rest is, shape (n, 2).

    Size of the force against its median in the middle, and change of the force. A hand that leans
    slowly changes the direction little from window to window, and the gyros see that.
    """
    force = windows.force[a:b]
    size = np.linalg.norm(force, axis=1)
    quarter = (b - a) // 4
    middle = slice(quarter, b - a - quarter)
    change = np.linalg.norm(np.gradient(force, axis=0), axis=1)
    return np.column_stack([np.abs(size - np.median(size[middle])), change])


def _edge(windows: Windows, a: int, b: int, most: int, at_end: int) -> FloatArray:
    """Deviations from the edge inwards, shape (most, 2), nan beyond the middle."""
    deviation = _deviations(windows, a, b)
    half = min(most, (b - a) // 2)
    result = np.full((most, 2), np.nan)
    result[:half] = (deviation[::-1] if at_end else deviation)[:half]
    return result


def _usual_deviation(windows: Windows, rests: list[Edges]) -> FloatArray:
    """Median over the rests of what their middles deviate by, shape (2,)."""
    middles = []
    for a, b, *_ in rests:
        quarter = (b - a) // 4
        middles.append(np.median(_deviations(windows, a, b)[quarter : b - a - quarter], axis=0))
    usual: FloatArray = np.median(np.array(middles), axis=0)
    return usual
