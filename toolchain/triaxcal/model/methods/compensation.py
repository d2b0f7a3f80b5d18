"""What the device evaluates at a temperature, in floats.

Two forms cover all methods:

direct   a = N(T) U + b(T), twelve functions fitted or derived here;
inverse  a = K(T)^-1 (U - U0(T)), K and U0 as fitted, inverted on the device.

Each method is a file of `model.methods`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.method import DIRECT, Target
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.metrological import exact_gain_and_offset, unpack_constants
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class Compensation:
    """Twelve functions of temperature and how the device uses them.

    Attributes
    ----------
    method : str
        Name of a compensation method.
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


def compensate(
    thermal: ThermalModel,
    method: str,
    range_degc: tuple[float, float],
    voltage_max_v: float,
    error_max_g: float,
    *,
    terms: Terms = NO_TERMS,
    order_min: int = 1,
) -> Compensation:
    """Functions that the device evaluates for a fitted thermal model.

    `voltage_max_v`, `error_max_g` and `order_min` are those of a `Target`. `terms` are taken over
    as they are: they apply to the linear result, whatever computes it.
    """
    entry = METHODS[method]
    curves = _restrict(thermal.curves, range_degc)
    target = Target(curves, voltage_max_v, error_max_g, order_min)
    return Compensation(method, entry.form, entry.functions(thermal, target), terms)


def _restrict(curves: PiecewisePolynomial, range_degc: tuple[float, float]) -> PiecewisePolynomial:
    """Take the same functions on the segments that the range touches."""
    low, high = range_degc
    inner = [b for b in curves.breaks_degc[1:-1] if low < b < high]
    breaks = (low, *inner, high)
    middles = np.array([(a + b) / 2 for a, b in pairwise(breaks)])
    segment = curves.segment_index(middles)
    origins = tuple(float(curves.origins_degc[int(s)]) for s in segment)
    return PiecewisePolynomial(breaks, origins, curves.coefficients[segment])
