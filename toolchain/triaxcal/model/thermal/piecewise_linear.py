"""Piecewise-linear function of P1 (4), made continuous.

The basis is one hat a knot, 1 there and 0 at its neighbours. Knots at the lowest temperature, T0
and the highest give the two segments of P1 (12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.thermal.knots import KNOTS_KEY, KnottedShape, knots_key
from triaxcal.model.thermal.shape import Settings, ThermalFunction, ThermalShape
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class PiecewiseLinearShape(KnottedShape):
    """Straight lines between knots."""

    name = "piecewise-linear"
    title = "piecewise-linear"
    within_points = True

    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        temp = np.asarray(temp_degc, dtype=np.float64)
        knots, segment = np.asarray(self.knots_degc), self.segment_of(temp)
        upper = (temp - knots[segment]) / (knots[segment + 1] - knots[segment])
        index = np.arange(len(knots))
        return np.where(index == segment[..., None], 1.0 - upper[..., None], 0.0) + np.where(
            index == segment[..., None] + 1, upper[..., None], 0.0
        )

    def curves(self, parameters: FloatArray) -> PiecewisePolynomial:
        slopes = np.diff(parameters, axis=1) / np.diff(self.knots_degc)
        return self.segments(np.stack([parameters[:, :-1], slopes], axis=-1), parameters)


def _stated(settings: Settings, temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    return (PiecewiseLinearShape.over(temps, t0, settings.get(KNOTS_KEY)),)


def _candidates(temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    # With two temperatures one segment is the polynomial of order 1.
    few = (PiecewiseLinearShape.over(temps, t0),) if len(temps) > 2 else ()
    return (*few, PiecewiseLinearShape.through(temps, t0)) if len(temps) > 3 else few


ENTRY = ThermalFunction(
    name=PiecewiseLinearShape.name,
    label=PiecewiseLinearShape.title,
    doc="Straight lines that meet at knots.",
    keys=(knots_key("piecewise-linear: T0, two segments"),),
    stated=_stated,
    candidates=_candidates,
    exact=PiecewiseLinearShape.through,
    least_temps=2,
    rank=20,
)
