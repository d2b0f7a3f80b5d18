"""Natural cubic spline: cubic polynomials that meet at knots with equal slope and curvature.

The curvature is zero at both end knots; of all curves through the knots' values this one bends
least (the integral of the squared second derivative). With values y, second derivatives M and
distances h of the knots, continuity of the slope at each inner knot is

    h_{i-1} M_{i-1} + 2 (h_{i-1} + h_i) M_i + h_i M_{i+1} = 6 (d_i - d_{i-1}),  d_i = dy_i / h_i,

M_0 = M_K = 0, and segment i is y_i + (d_i - h_i (2 M_i + M_{i+1}) / 6) t + M_i / 2 t^2
+ (M_{i+1} - M_i) / (6 h_i) t^3, t from the lower knot (de Boor, A Practical Guide to Splines,
chapter IV).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.thermal.knots import KNOTS_KEY, KnottedShape, knots_key
from triaxcal.model.thermal.shape import Settings, ThermalFunction, ThermalShape
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class CubicSplineShape(KnottedShape):
    """Natural cubic spline through values at knots."""

    name = "cubic-spline"
    title = "natural cubic spline"

    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        temp = np.asarray(temp_degc, dtype=np.float64)
        segment = self.segment_of(temp)
        t = temp - np.asarray(self.knots_degc)[segment]
        cardinal = np.moveaxis(self._from_knots(np.eye(self.parameters))[:, segment], 0, -2)
        values: FloatArray = np.einsum("...pn,...n->...p", cardinal, t[..., None] ** np.arange(4))
        return values

    def curves(self, parameters: FloatArray) -> PiecewisePolynomial:
        return self.segments(self._from_knots(parameters), parameters)

    def _from_knots(self, values: FloatArray) -> FloatArray:
        """Coefficients (n, segments, 4), from the lower knot, of splines through values (n, K)."""
        h = np.diff(self.knots_degc)
        d = np.diff(values, axis=1) / h
        M = np.zeros_like(values)
        if len(h) > 1:
            inner = np.diag(2.0 * (h[:-1] + h[1:])) + np.diag(h[1:-1], 1) + np.diag(h[1:-1], -1)
            M[:, 1:-1] = np.linalg.solve(inner, 6.0 * np.diff(d, axis=1).T).T
        slope = d - h * (2.0 * M[:, :-1] + M[:, 1:]) / 6.0
        cubic = np.diff(M, axis=1) / (6.0 * h)
        return np.stack([values[:, :-1], slope, M[:, :-1] / 2.0, cubic], axis=-1)


def _both(temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    both = (CubicSplineShape.over(temps, t0), CubicSplineShape.through(temps, t0))
    return tuple(dict.fromkeys(both))


def _candidates(temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    # Up to three temperatures nothing would show that it is better than the parabola; with two
    # knots it is the polynomial of order 1.
    shapes = _both(temps, t0) if len(temps) > 3 else ()
    return tuple(shape for shape in shapes if shape.parameters > 2)


def _stated(settings: Settings, temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    knots = settings.get(KNOTS_KEY)
    return _both(temps, t0) if knots is None else (CubicSplineShape.over(temps, t0, knots),)


ENTRY = ThermalFunction(
    name=CubicSplineShape.name,
    label=CubicSplineShape.title,
    doc="Natural cubic spline: equal slope and curvature at the knots, no curvature at the ends.",
    keys=(knots_key("cubic-spline: T0 or every calibrated temperature, by held-out error"),),
    stated=_stated,
    candidates=_candidates,
    exact=CubicSplineShape.through,
    least_temps=2,
    rank=30,
)
