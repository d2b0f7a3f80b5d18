"""Degrees of freedom and coverage factors, GUM annex G."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache

import numpy as np

from triaxcal.model.types import FloatArray

LEVEL = 0.95
_MANY = 200
"""From here on three terms of the expansion about the normal quantile are right to 1e-8."""
_NORMAL = 1.959963984540054
_ROOT_2 = math.sqrt(2.0)


def effective_dof(contributions: Iterable[tuple[float, float]]) -> float:
    """Welch-Satterthwaite, GUM (G.2b): of pairs (standard uncertainty, degrees of freedom)."""
    pairs = list(contributions)
    scale = max((u for u, _ in pairs), default=0.0)
    if scale == 0.0:
        return math.inf
    total = math.fsum((u / scale) ** 2 for u, _ in pairs)
    loss = math.fsum((u / scale) ** 4 / dof for u, dof in pairs)
    return math.inf if loss == 0.0 else total**2 / loss


@cache
def _student_95(dof: int) -> float:
    low, high = 1.9, 13.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if student_within(middle, dof) < LEVEL else (low, middle)
    return 0.5 * (low + high)


def coverage_factor(dof: float) -> float:
    """k of a 95 % interval; degrees of freedom are rounded down, GUM (G.4.1), at least 1."""
    if dof >= _MANY:
        return _expansion(_NORMAL, math.floor(dof) if math.isfinite(dof) else math.inf)
    return _student_95(max(1, math.floor(dof + 1e-9)))


def with_offset(half_width: FloatArray, offset: FloatArray) -> FloatArray:
    """Half the 95 % interval about a value that is off by a known offset, not corrected.

    The q of P(|offset + s Z| < q) = 95 % with a normal Z, s the half-width without it / 1.96. An
    offset squared among variances would make it 1.96 times the offset where it is large.

    Parameters
    ----------
    half_width, offset : arrays of one shape
        Both at least 0.
    """
    sd = half_width / _NORMAL
    ratio = np.minimum(offset, 4.0 * sd) / np.maximum(sd, 1e-300)
    result: FloatArray = offset + sd * np.interp(ratio, *_beyond_offset())
    return result


@cache
def _beyond_offset() -> tuple[FloatArray, FloatArray]:
    """Offsets, and q less them, in standard deviations; from 4 on the 1.645 of one side."""
    offsets = np.linspace(0.0, 4.0, 81)
    return offsets, np.array([_within(float(r)) - float(r) for r in offsets])


def _within(offset: float) -> float:
    low, high = 1.5, offset + 2.0
    for _ in range(50):
        q = 0.5 * (low + high)
        inside = 0.5 * (math.erf((q - offset) / _ROOT_2) + math.erf((q + offset) / _ROOT_2))
        low, high = (q, high) if inside < LEVEL else (low, q)
    return 0.5 * (low + high)


def _expansion(z: float, dof: float) -> float:
    """Student's quantile about the normal one z, Abramowitz and Stegun 26.7.5."""
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    return z + first / dof + second / dof**2 + third / dof**3


def student_within(t: float, dof: int) -> float:
    """Probability that |t| of Student with whole degrees of freedom stays below t.

    The finite series of Abramowitz and Stegun, 26.7.3 and 26.7.4.
    """
    angle = math.atan(t / math.sqrt(dof))
    sine, cosine = math.sin(angle), math.cos(angle)
    start = 2 if dof % 2 == 0 else 3
    term = total = 1.0 if dof % 2 == 0 else cosine
    if dof == 1:
        return 2.0 * angle / math.pi
    for n in range(start, dof - 1, 2):
        term *= cosine**2 * (n - 1) / n
        total += term
    return sine * total if dof % 2 == 0 else (angle + sine * total) * 2.0 / math.pi
