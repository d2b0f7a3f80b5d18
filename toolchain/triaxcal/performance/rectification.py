"""Shift of the mean output under vibration: exact means of a square, an odd square and a cube.

An axis feels s + n: a static force s and a vibration n of mean 0, the sum of a Gaussian part of
variance v and of a sine of amplitude A. The shift of the mean of f is E f(s + n) - f(s):

    a^2      v + A^2 / 2
    a^3      3 s (v + A^2 / 2)                                      E n = E n^3 = 0
    a_j a_k  covariance of the two axes

and for a |a| of a Gaussian x of mean m and standard deviation d, phi and Phi the normal density and
distribution,

    E x |x| = (m^2 + d^2) (2 Phi(m / d) - 1) + 2 m d phi(m / d)

because x |x| = x^2 (2 [x > 0] - 1). A sine alone, s = A sin t0 within it, has

    E = ((2 s^2 + A^2) t0 + 3 s sqrt(A^2 - s^2)) / pi

from x^2 integrated over the part of the turn in which x > 0, less the rest. Both together are the
first, averaged over the turn. docs/explanation/test-report.md has the steps.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.model.types import FloatArray

_PHASES = 512
"""Of the mean over a turn: the trapezoidal rule is exact there but for the kink, and where random
vibration smooths it."""


def square_shift(variance: float, amplitude: float) -> float:
    """Shift of the mean of a^2, g^2."""
    return variance + amplitude**2 / 2.0


def cube_shift(static: float, variance: float, amplitude: float) -> float:
    """Shift of the mean of a^3, g^3."""
    return 3.0 * static * square_shift(variance, amplitude)


def odd_shift(static: float, variance: float, amplitude: float) -> float:
    """Shift of the mean of a |a|, g^2."""
    if amplitude == 0.0:
        mean = _gaussian_odd(np.array([static]), variance)
    elif variance == 0.0:
        mean = np.array([_sine_odd(static, amplitude)])
    else:
        turn = 2.0 * np.pi * (np.arange(_PHASES) + 0.5) / _PHASES
        mean = _gaussian_odd(static + amplitude * np.sin(turn), variance)
    return float(mean.mean()) - static * abs(static)


def _gaussian_odd(mean: FloatArray, variance: float) -> FloatArray:
    if variance == 0.0:
        return np.asarray(mean * np.abs(mean))
    sd = math.sqrt(variance)
    z = mean / sd
    density = np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
    within = np.array([math.erf(v / math.sqrt(2.0)) for v in z])
    result: FloatArray = (mean**2 + variance) * within + 2.0 * mean * sd * density
    return result


def _sine_odd(static: float, amplitude: float) -> float:
    if abs(static) >= amplitude:
        return math.copysign(static**2 + amplitude**2 / 2.0, static)
    turn = math.asin(static / amplitude)
    rest = 3.0 * static * math.sqrt(amplitude**2 - static**2)
    return ((2.0 * static**2 + amplitude**2) * turn + rest) / math.pi


def beyond(static: float, variance: float, amplitude: float, limit: float) -> float:
    """Probability that static force and vibration together are above a limit."""
    turn = 2.0 * np.pi * (np.arange(_PHASES) + 0.5) / _PHASES
    level = static + amplitude * np.sin(turn) - limit
    if variance == 0.0:
        return float(np.mean(level > 0.0))
    sd = math.sqrt(2.0 * variance)
    return float(np.mean([0.5 * math.erfc(-v / sd) for v in level]))
