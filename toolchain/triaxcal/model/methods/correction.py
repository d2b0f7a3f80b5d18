"""The additive methods of P1: with the constants of T0, plus a correction that follows temperature.

The correction Delta_a is linear in U, so a + Delta_a is again a matrix and an offset. With
dK = K(T) - K(T0) and dU0 = U0(T) - U0(T0) the correction is *added*: the sign printed in P1 doubles
the error (docs/explanation/theory.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.method import Target
from triaxcal.model.metrological import exact_gain_and_offset, pack_constants, unpack_constants
from triaxcal.model.types import FloatArray

Correction = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Of K0, dK and dU0: factor of (U - U0) and the constant part of Delta_a."""


def added(correction: Correction, thermal: ThermalModel, target: Target) -> PiecewisePolynomial:
    """Write a + Delta_a as N U + b: N = N0 + D(T), b = -N0 U00 - D(T) U00 + e(T)."""
    curves, at_t0 = target.curves, thermal.constants_at(thermal.t0_degc)
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
