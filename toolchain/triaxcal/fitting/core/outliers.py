"""Poses that the others contradict: externally studentised residuals.

With e the residual of pose k in the fit and d its held-out error, e.d is what the
squares of the fit lose without it (exactly for least squares). Of n poses of c components and p
constants, pose k alone being good,

    F = (e.d / c) / ((sum e^2 - e.d) / (c (n - 1) - p))

follows Fisher's F with c and c (n - 1) - p degrees of freedom. A pose is reported when its chance,
times the number of poses that were tested (Bonferroni), is below `CHANCE`.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray

CHANCE = 1e-3
"""Probability that a pose of a good recording is reported."""
_OF_NONCENTRALITY = 1e-6
"""Relative precision of it: no figure shows more digits."""
_NEVER = 5.0
"""An F below this has a chance above `CHANCE` with up to three components: chi2(3) / 3 is 5.4."""
_MOST_TERMS = 10_000
"""Of the continued fraction: about the square root of the degrees of freedom are needed."""
_ALIKE = 0.9
"""Share of the largest loss: poses as suspect as the worst, such as the opposite face."""


@dataclass(frozen=True)
class Outlier:
    """Poses of which one contradicts the others.

    Attributes
    ----------
    indices : tuple of int
        The worst first; more than one if the poses do not show which it is.
    chance : float
        Probability that a good recording has as bad a pose.
    others : float
        Rms residual of a component without it, in the residuals' unit.
    """

    indices: tuple[int, ...]
    chance: float
    others: float


def left_out_residuals(own: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Residuals (n,) of least squares with each row of the Jacobian (n, p) held out in turn."""
    leverage = (np.linalg.qr(jacobian)[0] ** 2).sum(axis=1)
    result: FloatArray = own / np.maximum(1.0 - leverage, 1e-9)
    return result


def worst_outlier(own: FloatArray, left_out: FloatArray, parameters: int) -> Outlier | None:
    """The pose that fits worst, if it does so significantly.

    Parameters
    ----------
    own, left_out : arrays, shape (n, c)
        Residuals in the fit of all poses, and with each pose held out in turn.
    parameters : int
        Constants of the fit.
    """
    count, components = own.shape
    dof = components * (count - 1) - parameters
    if dof < 1:
        return None
    loss = np.maximum((own * left_out).sum(axis=1), 0.0)
    total = float((own**2).sum())
    # Residuals that are only rounding would leave 0: the smallest share is kept.
    rest = np.maximum(total - loss, 1e-24 * total)
    worst = int(loss.argmax())
    if not loss[worst] > 0.0:
        return None
    ratio = float(loss[worst] / components / (rest[worst] / dof))
    if ratio < _NEVER:
        return None
    chance = fisher_tail(components, dof, ratio) * count
    if chance > CHANCE:
        return None
    alike = np.flatnonzero(loss >= _ALIKE * loss[worst])
    near = loss >= (1.0 - 1e-6) * loss[worst]  # equal but for rounding: the first row is the worst
    indices = sorted(alike.tolist(), key=lambda k: (not near[k], k))
    return Outlier(tuple(indices), chance, float(np.sqrt(rest[worst] / dof)))


def fisher_tail(components: int, dof: int, ratio: float) -> float:
    """Chance that Fisher's F with `components` and `dof` degrees of freedom exceeds `ratio` >= 1.

    The regularised incomplete beta function I_x(dof / 2, components / 2) at
    x = dof / (dof + components ratio), by its continued fraction (DLMF 8.17.22) with the
    recurrence of Lentz. For ratio >= 1, x is below (a + 1) / (a + b + 2), where the fraction
    converges. Importing SciPy for it takes half as long as a whole calibration.
    """
    a, b = dof / 2, components / 2
    x = dof / (dof + components * ratio)
    y = components * ratio / (dof + components * ratio)
    upper, lower = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1))
    fraction = lower
    for m in range(1, _MOST_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        before = fraction
        for term in (even, odd):
            upper, lower = 1.0 + term / upper, 1.0 / (1.0 + term * lower)
            fraction *= upper * lower
        if abs(fraction - before) <= sys.float_info.epsilon * abs(fraction):
            break
    beta = math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    return math.exp(a * math.log(x) + b * math.log(y) - beta) * fraction / a


def noncentrality(power: float, components: int, dof: int, ratio: float) -> float:
    """Non-centrality with which F of `components` and `dof` exceeds `ratio` with a chance `power`.

    The numerator is non-central; F without it must exceed `ratio` more rarely than that.
    """
    # Of a check alone: SciPy takes long to import.
    from scipy.special import ncfdtr  # noqa: PLC0415

    def misses(h: float) -> bool:
        return float(ncfdtr(components, dof, h, ratio)) > 1.0 - power

    low, high = 0.0, 1.0
    while misses(high):
        low, high = high, 2.0 * high
    while high - low > _OF_NONCENTRALITY * high:
        middle = (low + high) / 2.0
        low, high = (middle, high) if misses(middle) else (low, middle)
    return high
