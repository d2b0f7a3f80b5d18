"""Readings for beats of the clock without a row, and how far they may be off.

A missing reading is interpolated by a polynomial through the readings around it. With weights w_j
the sum over a hole of k readings becomes sum_j w_j x_j, and is off by

    e = sum_j w_j x_j - sum_hole x,

which has no covariance with the sum of all readings, because the w_j add up to k. So the variance
of the angle over a hole is h^2 var(e) larger than if nothing were lost. var(e) is measured: the
same hole is made where the readings around it are known, and the mean square of e there has both
the noise and what the motion does beside the polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.types import FloatArray, IntArray

SIDES = (1, 2, 3)
"""Readings on each side of a hole that a polynomial goes through: line, cubic, quintic."""
LONGEST_S = 0.25
"""Within it a unit that rests before and after has not been turned: a hand needs longer."""
TRIALS = (12, 40)
"""How many places on each side are tried: close by, and as far as the motion is alike."""
LEAST_TRIALS = 6


@dataclass(frozen=True)
class Hole:
    """Readings for a hole, and their uncertainty.

    Attributes
    ----------
    values : array, shape (k, columns)
    variance : array, shape (columns,)
        Of the sum of the k readings, beyond that of their noise.
    """

    values: FloatArray
    variance: FloatArray


def fill(known: IntArray, values: FloatArray, first: int, count: int) -> Hole | None:
    """Readings of the beats `first` to `first + count`.

    By the polynomial that does best nearby, for each column.

    Parameters
    ----------
    known : array, shape (n,)
        Beats that have readings, rising, around the hole.
    values : array, shape (n, columns)

    Returns
    -------
    Hole or None
        None where too little is known around it.
    """
    after = int(np.searchsorted(known, first))
    hole = np.arange(first, first + count)
    best: Hole | None = None
    for sides in SIDES:
        if after < sides or after + sides > len(known):
            continue
        near = slice(after - sides, after + sides)
        weights = lagrange_weights(known[near], hole)
        variance = _tried(known, values, known[near], hole, weights.sum(axis=0))
        if variance is None:
            continue
        made = Hole(weights @ values[near], variance)
        if best is None:
            best = made
        else:
            better = made.variance < best.variance
            best = Hole(
                np.where(better, made.values, best.values),
                np.where(better, made.variance, best.variance),
            )
    return best


def lagrange_weights(known: IntArray, wanted: IntArray | FloatArray) -> FloatArray:
    """Weights (wanted, known) of the polynomial through the known places, by Lagrange."""
    weights = np.ones((len(wanted), len(known)))
    for j, at in enumerate(known.tolist()):
        others = np.delete(known, j)
        weights[:, j] = np.prod((wanted[:, None] - others) / (at - others), axis=1)
    return weights


def _tried(
    known: IntArray, values: FloatArray, near: IntArray, hole: IntArray, weights: FloatArray
) -> FloatArray | None:
    """Mean square (columns,) of e at shifted places where every reading is known; None if too few.

    The larger one of the places close by and of all.
    """
    extent = int(near[-1] - near[0]) + 1
    base = int(known[0])
    place = np.full(int(known[-1]) - base + 1, -1)
    place[known - base] = np.arange(len(known))
    shift = np.arange(1, extent + TRIALS[1])
    shift = np.stack([shift, -shift], axis=1).ravel()
    beats = np.concatenate([near, hole]) - base + shift[:, None]
    inside = (beats.min(axis=1) >= 0) & (beats.max(axis=1) < len(place))
    index = place[beats[inside]]
    whole = (index >= 0).all(axis=1)
    if whole.sum() < LEAST_TRIALS:
        return None
    close = np.abs(shift[inside][whole]) < extent + TRIALS[0]
    x = values[index[whole]]
    square = (np.einsum("j,njc->nc", weights, x[:, : len(near)]) - x[:, len(near) :].sum(1)) ** 2
    mean = square.mean(axis=0)
    if close.sum() < LEAST_TRIALS:
        return np.asarray(mean)
    return np.asarray(np.maximum(square[close].mean(axis=0), mean))


def holes(number: IntArray, longest: int) -> list[tuple[int, int]]:
    """First beat and length of each hole of at most `longest` beats."""
    return [(a + 1, b - a - 1) for a, b in pairwise(number.tolist()) if 1 < b - a <= longest + 1]
