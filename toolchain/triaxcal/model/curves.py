"""Curves of the twelve constants over temperature: P1 (3), (4) and others in one form.

Every thermal function is a piecewise polynomial. Beyond two segments the paper's form (4), anchored
at T0, is discontinuous; here each segment has its own origin, so neighbours meet at the knots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb

import numpy as np

from triaxcal.model.metrological import BIASES
from triaxcal.model.types import FloatArray, IntArray


@dataclass(frozen=True)
class PiecewisePolynomial:
    """A vector of functions of temperature, one polynomial a segment.

    Attributes
    ----------
    breaks_degc : tuple of float, length m + 1
        Ends of the m segments, rising. A temperature on an inner break belongs to the segment
        above it; one outside is evaluated on the end segment (callers clamp first).
    origins_degc : tuple of float, length m
        Where each segment's dT is zero.
    coefficients : array, shape (m, functions, order + 1)
        Per degC^n, constant term first.
    """

    breaks_degc: tuple[float, ...]
    origins_degc: tuple[float, ...]
    coefficients: FloatArray

    def __post_init__(self) -> None:
        segments = len(self.origins_degc)
        if len(self.breaks_degc) != segments + 1 or self.coefficients.shape[0] != segments:
            raise ValueError("breaks, origins and coefficients disagree about the segments")
        if any(b <= a for a, b in pairwise(self.breaks_degc)):
            raise ValueError("breaks must rise")

    @property
    def order(self) -> int:
        """Order of the polynomials."""
        return int(self.coefficients.shape[2]) - 1

    def segment_index(self, temp_degc: FloatArray) -> IntArray:
        """Segment of each temperature, same shape as `temp_degc`."""
        inner = np.asarray(self.breaks_degc[1:-1])
        return np.searchsorted(inner, temp_degc, side="right").astype(np.int64)

    def __call__(self, temp_degc: FloatArray | float) -> FloatArray:
        """Values, shape (..., functions), at temperatures of shape (...)."""
        temp = np.asarray(temp_degc, dtype=np.float64)
        segment = self.segment_index(temp)
        delta = temp - np.asarray(self.origins_degc)[segment]
        coefficients = self.coefficients[segment]
        value = coefficients[..., self.order]
        for n in range(self.order - 1, -1, -1):
            value = value * delta[..., None] + coefficients[..., n]
        result: FloatArray = np.asarray(value)
        return result


@dataclass(frozen=True)
class ThermalModel:
    """The twelve constants over temperature.

    Attributes
    ----------
    t0_degc : float
        Reference temperature of the relative coefficients, P1 (3).
    curves : PiecewisePolynomial
        Twelve functions in the order of `CONSTANT_NAMES`: V/g for K, V for U0.
    """

    t0_degc: float
    curves: PiecewisePolynomial

    def constants_at(self, temp_degc: FloatArray | float) -> FloatArray:
        """Twelve constants, shape (..., 12), at temperatures of shape (...)."""
        return self.curves(temp_degc)


def on_common_breaks(
    parts: Sequence[PiecewisePolynomial], t0_degc: float
) -> tuple[tuple[float, ...], tuple[float, ...], list[FloatArray]]:
    """The same functions on the breaks of all: breaks, origins, coefficients of each.

    T0 is the origin of segments that touch it, the lower break that of others.
    """
    inner = sorted({b for part in parts for b in part.breaks_degc[1:-1]})
    low = min(part.breaks_degc[0] for part in parts)
    high = max(part.breaks_degc[-1] for part in parts)
    breaks = (low, *(b for b in inner if low < b < high), high)
    order = max(part.order for part in parts)
    origins = tuple(
        t0_degc if len(breaks) == 2 or a <= t0_degc <= b else a for a, b in pairwise(breaks)
    )
    found = []
    for part in parts:
        rows = []
        for (a, b), origin in zip(pairwise(breaks), origins, strict=True):
            segment = int(part.segment_index(np.array((a + b) / 2)))
            own = part.coefficients[segment]
            rows.append(_shifted(own, origin - part.origins_degc[segment], order))
        found.append(np.stack(rows))
    return breaks, origins, found


def _shifted(coefficients: FloatArray, by: float, order: int) -> FloatArray:
    """Coefficients (functions, order + 1) of f(x + by), for those of f(x)."""
    shifted = np.zeros((len(coefficients), order + 1))
    for n in range(coefficients.shape[1]):
        for k in range(n + 1):
            shifted[:, k] += comb(n, k) * by ** (n - k) * coefficients[:, n]
    return shifted


def relative_coefficients(model: ThermalModel) -> FloatArray:
    """Coefficients alpha, beta, gamma of P1 (3), (4), shape (segments, 12, order).

    Those of K are divided by the constant's value at T0 (P1 (11) lacks this division in print),
    1/degC^n; those of U0 (alpha) are V/degC^n. In a segment that does not touch T0 they belong
    to the segment's own origin. NaN where a constant of K is zero at T0: it has no relative form.
    """
    relative = model.curves.coefficients[:, :, 1:].copy()
    at_t0 = model.constants_at(model.t0_degc)
    divisor = np.where(np.isin(np.arange(12), BIASES), 1.0, at_t0)[:, None]
    result: FloatArray = np.divide(
        relative, divisor, out=np.full_like(relative, np.nan), where=divisor != 0.0
    )
    return result
