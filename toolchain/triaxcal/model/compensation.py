"""What the device evaluates at a temperature, in floats: the three compensation methods of P1.

Two forms cover them all:

direct   a = N(T) U + b(T), twelve functions fitted or derived here;
inverse  a = K(T)^-1 (U - U0(T)), K and U0 as fitted, inverted on the device.

"matrix" and "additive" are direct: the additive correction of P1, Delta_a, is linear in U, so
a + Delta_a is again a matrix and an offset. With dK = K(T) - K(T0) and dU0 = U0(T) - U0(T0) the
correction is *added*: the sign printed in P1 doubles the error (docs/theory.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.metrological import pack_constants, unpack_constants
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.thermal import PiecewisePolynomial, ThermalModel
from triaxcal.model.types import FloatArray

DIRECT = "direct"
INVERSE = "inverse"
MAX_ORDER = 9
"""Beyond this a polynomial of N(T) gains nothing on the rounding of its coefficients."""


@dataclass(frozen=True)
class Compensation:
    """Twelve functions of temperature and how the device uses them.

    Attributes
    ----------
    method : str
        One of `unitfile.METHODS`.
    form : str
        "direct": functions are N (g/V, row by row) and b (g), a = N U + b.
        "inverse": functions are K (V/g) and U0 (V), a = K^-1 (U - U0).
    curves : PiecewisePolynomial
        Twelve functions, matrix row by row and then the offset, over the working range.
    terms : Terms
        Quadratic and dT/dt terms, of the linear result in g.
    """

    method: str
    form: str
    curves: PiecewisePolynomial
    terms: Terms = NO_TERMS

    def gain_and_offset(self, temp_degc: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """N (..., 3, 3) in g/V and b (..., 3) in g at temperatures of shape (...)."""
        functions = self.curves(temp_degc)
        if self.form == DIRECT:
            return unpack_constants(functions)
        return exact_gain_and_offset(functions)

    def evaluate(
        self,
        voltage_v: FloatArray,
        temp_degc: FloatArray | float,
        rate_k_per_s: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Specific force (..., 3) in g of voltages (..., 3), temperatures and dT/dt (...)."""
        N, b = self.gain_and_offset(temp_degc)
        linear = np.einsum("...ij,...j->...i", N, voltage_v) + b
        return self.terms.force_g(linear, rate_k_per_s)


def exact_gain_and_offset(constants: FloatArray) -> tuple[FloatArray, FloatArray]:
    """N = K^-1 (..., 3, 3) in g/V and b = -N U0 (..., 3) in g of constants (..., 12)."""
    K, U0 = unpack_constants(constants)
    N = np.linalg.inv(K).astype(np.float64)
    return N, -np.einsum("...ij,...j->...i", N, U0)


def worst_force_error_g(
    found: tuple[FloatArray, FloatArray],
    exact: tuple[FloatArray, FloatArray],
    voltage_max_v: float,
) -> FloatArray:
    """Largest |error| per axis over all |U_j| <= voltage_max_v, shape (..., 3), in g.

    N U + b is linear in U, so the worst case lies in a corner of the box.
    """
    gain_error = np.abs(found[0] - exact[0]).sum(axis=-1)
    worst: FloatArray = gain_error * voltage_max_v + np.abs(found[1] - exact[1])
    return worst


def compensate(
    thermal: ThermalModel,
    method: str,
    range_degc: tuple[float, float],
    voltage_max_v: float,
    error_max_g: float,
    *,
    terms: Terms = NO_TERMS,
) -> Compensation:
    """Functions that the device evaluates for a fitted thermal model.

    For "matrix" the order of N(T) is the lowest whose error against K(T)^-1 (U - U0(T)) stays
    within `error_max_g` over the range and the box |U_j| <= voltage_max_v, or `MAX_ORDER`: the
    caller measures what was reached, by `worst_force_error_g`, at every temperature code. `terms`
    are taken over as they are: they apply to the linear result, whatever computes it.
    """
    curves = _restrict(thermal.curves, range_degc)
    if method == "inverse":
        return Compensation(method, INVERSE, curves, terms)
    if method == "matrix":
        fitted = _fit_inverse(thermal, curves.breaks_degc, voltage_max_v, error_max_g)
        return Compensation(method, DIRECT, fitted, terms)
    correction = _ADDITIVE[method]
    return Compensation(method, DIRECT, _additive(thermal, curves, correction), terms)


def _restrict(curves: PiecewisePolynomial, range_degc: tuple[float, float]) -> PiecewisePolynomial:
    """Take the same functions on the segments that the range touches."""
    low, high = range_degc
    inner = [b for b in curves.breaks_degc[1:-1] if low < b < high]
    breaks = (low, *inner, high)
    middles = np.array([(a + b) / 2 for a, b in pairwise(breaks)])
    segment = curves.segment_index(middles)
    origins = tuple(float(curves.origins_degc[int(s)]) for s in segment)
    return PiecewisePolynomial(breaks, origins, curves.coefficients[segment])


def _fit_inverse(
    thermal: ThermalModel, breaks: tuple[float, ...], voltage_max_v: float, error_max_g: float
) -> PiecewisePolynomial:
    """N(T) and b(T) by interpolation at Chebyshev points, one polynomial a segment."""
    for order in range(1, MAX_ORDER + 1):
        result = _chebyshev(thermal, breaks, order)
        # A tenth is left for the codes between the samples.
        if _sampled_error_g(thermal, result, voltage_max_v) <= 0.9 * error_max_g:
            break
    return result


def _chebyshev(thermal: ThermalModel, breaks: tuple[float, ...], order: int) -> PiecewisePolynomial:
    origins, rows = [], []
    for low, high in pairwise(breaks):
        middle, half = (low + high) / 2, (high - low) / 2
        x = np.cos(np.pi * (np.arange(order + 1) + 0.5) / (order + 1))
        N, b = exact_gain_and_offset(_segment_constants(thermal, middle, middle + half * x))
        vandermonde = np.vander(x, increasing=True)
        in_x = np.linalg.solve(vandermonde, pack_constants(N, b))
        rows.append((in_x / half ** np.arange(order + 1)[:, None]).T)
        origins.append(middle)
    return PiecewisePolynomial(breaks, tuple(origins), np.array(rows))


def _segment_constants(thermal: ThermalModel, inside_degc: float, temp: FloatArray) -> FloatArray:
    """Constants at `temp` by the polynomial of the segment that holds `inside_degc`."""
    curves = thermal.curves
    s = int(curves.segment_index(np.array(inside_degc)))
    powers = np.vander(temp - curves.origins_degc[s], curves.order + 1, increasing=True)
    constants: FloatArray = powers @ curves.coefficients[s].T
    return constants


def _sampled_error_g(
    thermal: ThermalModel, curves: PiecewisePolynomial, voltage_max_v: float
) -> float:
    low, high = curves.breaks_degc[0], curves.breaks_degc[-1]
    temp = np.linspace(low, high, 1001)
    found = unpack_constants(curves(temp))
    exact = exact_gain_and_offset(thermal.constants_at(temp))
    return float(worst_force_error_g(found, exact, voltage_max_v).max())


def _correction_printed(
    K0: FloatArray, dK: FloatArray, dU0: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """P1 (5), (6): factor of (U - U0) and the constant part of Delta_a."""
    scale = np.diag(K0)
    both = np.outer(scale, scale)
    N = -K0 / both
    np.fill_diagonal(N, 1 / scale)
    return -dK / both, -np.einsum("ij,...j->...i", N, dU0)


def _correction_simplified(
    K0: FloatArray, dK: FloatArray, dU0: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """P1 (7), (8): the first and third terms of (5), (6) only."""
    scale = np.diag(K0)
    return -dK * np.eye(3) / scale**2, -dU0 / scale


def _correction_first_order(
    K0: FloatArray, dK: FloatArray, dU0: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Full first order of P1 (1): -(N dK N (U - U0) + N dU0), with the exact N = K0^-1."""
    N = np.linalg.inv(K0)
    factor: FloatArray = -(N @ dK @ N)
    return factor, -np.einsum("ij,...j->...i", N, dU0)


_Correction = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
_ADDITIVE: dict[str, _Correction] = {
    "additive": _correction_printed,
    "additive-simplified": _correction_simplified,
    "additive-first-order": _correction_first_order,
}


def _additive(
    thermal: ThermalModel, curves: PiecewisePolynomial, correction: _Correction
) -> PiecewisePolynomial:
    """Write a + Delta_a as N U + b: N = N0 + D(T), b = -N0 U00 - D(T) U00 + e(T)."""
    at_t0 = thermal.constants_at(thermal.t0_degc)
    K0, U00 = unpack_constants(at_t0)
    N0, b0 = exact_gain_and_offset(at_t0)
    # Every power of dT is corrected alike; the change at T0 itself is taken off the constant term.
    change = np.moveaxis(curves.coefficients, 2, 1).copy()
    change[:, 0, :] -= at_t0
    D, e = correction(K0, *unpack_constants(change))
    D, b = D.copy(), e - np.einsum("...ij,j->...i", D, U00)
    D[:, 0] += N0
    b[:, 0] += b0
    coefficients = np.moveaxis(pack_constants(D, b), 1, 2)
    return PiecewisePolynomial(curves.breaks_degc, curves.origins_degc, coefficients)
