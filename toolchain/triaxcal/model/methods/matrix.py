"""Method "matrix": N(T) = K(T)^-1 and b(T) = -N U0, polynomials fitted to them on each segment."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.method import DIRECT, CompensationMethod, Target
from triaxcal.model.metrological import (
    exact_gain_and_offset,
    pack_constants,
    unpack_constants,
    worst_force_error_g,
)
from triaxcal.model.types import FloatArray

MAX_ORDER = 9
"""Beyond this a polynomial of N(T) gains nothing on the rounding of its coefficients."""


def _functions(thermal: ThermalModel, target: Target) -> PiecewisePolynomial:
    """N(T) and b(T) by interpolation at Chebyshev points, one polynomial a segment.

    The order is the lowest from `order_min` whose error stays within the target's, or `MAX_ORDER`:
    the caller measures what was reached, by `worst_force_error_g`, at every temperature code.
    """
    for order in range(target.order_min, MAX_ORDER + 1):
        result = _chebyshev(thermal, target.curves.breaks_degc, order)
        # A tenth is left for the codes between the samples.
        if _sampled_error_g(thermal, result, target.voltage_max_v) <= 0.9 * target.error_max_g:
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


ENTRY = CompensationMethod(
    name="matrix",
    label="matrix",
    doc="K(T)^-1 and its offset as polynomials, within model_error_max_micro_g.",
    short_label="matrix",
    colour="#0a5fb4",
    form=DIRECT,
    functions=_functions,
    keeps_error=True,
    rank=10,
)
