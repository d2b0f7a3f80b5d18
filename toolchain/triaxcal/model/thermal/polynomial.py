"""Polynomial of P1 (3).

The basis is x^n, n = 0..order, x = (T - T0) / s, s the farthest calibrated |T - T0|: powers of degC
span many decades, powers of x do not. With order = temperatures - 1 the curve passes all points and
is that of P1 (11). The constant term is free, so with more temperatures the curve need not pass
the point at T0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key
from triaxcal.base.kinds import whole
from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.thermal.shape import (
    EDGE_DEGC,
    Settings,
    ThermalFunction,
    ThermalShape,
    ends_of,
    listed,
)
from triaxcal.model.types import FloatArray

AUTO_ORDER_MAX = 7
"""Highest order among the candidates; a higher one can be asked for."""
ORDER = Key(
    "order",
    whole(0, 9),
    "Order of the polynomial.",
    None,
    default_words="chosen by held-out error",
    example="3",
)


@dataclass(frozen=True)
class PolynomialShape(ThermalShape):
    """One polynomial over all temperatures."""

    name = "polynomial"

    order: int

    @classmethod
    def over(cls, temps_degc: FloatArray, t0_degc: float, order: int) -> PolynomialShape:
        """Polynomial of an order over calibrated temperatures of shape (G,)."""
        return cls(t0_degc, ends_of(temps_degc), order)

    @property
    def parameters(self) -> int:
        return self.order + 1

    @property
    def detail(self) -> str:
        return f"order {self.order}"

    @property
    def label(self) -> str:
        return f"polynomial of {self.detail}"

    @property
    def settings(self) -> Settings:
        return {ORDER.name: self.order}

    @property
    def scale_degc(self) -> float:
        """Temperature difference that stands for 1."""
        return max(abs(end - self.t0_degc) for end in self.ends_degc) or 1.0

    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        x = (np.asarray(temp_degc, dtype=np.float64) - self.t0_degc) / self.scale_degc
        powers: FloatArray = x[..., None] ** np.arange(self.order + 1)
        return powers

    def curves(self, parameters: FloatArray) -> PiecewisePolynomial:
        low, high = self.ends_degc
        # One temperature alone still makes a segment.
        breaks = (low, high) if low < high else (low - EDGE_DEGC, high + EDGE_DEGC)
        coefficients = parameters / self.scale_degc ** np.arange(self.order + 1)
        return PiecewisePolynomial(breaks, (self.t0_degc,), coefficients[None])

    def nested(self, parameters: int) -> PolynomialShape:
        return replace(self, order=parameters - 1)

    def without(self, remaining_degc: FloatArray, held_out_degc: float) -> PolynomialShape:  # noqa: ARG002
        return replace(self, order=min(self.order, len(remaining_degc) - 1))

    def undetermined(self, where: str, temps_degc: FloatArray) -> RefusedError | None:
        count = len(temps_degc)
        if self.order < count:
            return None
        return RefusedError(
            f"{where}, [thermal] {ORDER.name}",
            f"order {self.order} with {count} calibrated temperature"
            f"{'s' if count != 1 else ''} ({listed(temps_degc)} degC)",
            expected=f"{self.order + 1} temperatures for this order",
            remedy=f"the highest order possible is {count - 1}",
        )


def _stated(settings: Settings, temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    order = settings.get(ORDER.name)
    if order is None:
        return _candidates(temps, t0)
    return (PolynomialShape.over(temps, t0, order),)


def _candidates(temps: FloatArray, t0: float) -> tuple[ThermalShape, ...]:
    highest = min(len(temps) - 1, AUTO_ORDER_MAX)
    return tuple(PolynomialShape.over(temps, t0, order) for order in range(highest + 1))


ENTRY = ThermalFunction(
    name=PolynomialShape.name,
    label="polynomial",
    doc="One polynomial over all temperatures.",
    keys=(ORDER,),
    stated=_stated,
    candidates=_candidates,
    exact=lambda temps, t0: PolynomialShape.over(temps, t0, len(temps) - 1),
    nested=True,
    rank=10,
)
