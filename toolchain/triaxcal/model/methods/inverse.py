"""Method "inverse": K(T) and U0(T) as fitted; the device inverts K."""

from __future__ import annotations

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.method import INVERSE, CompensationMethod, Target


def _functions(_: ThermalModel, target: Target) -> PiecewisePolynomial:
    return target.curves


ENTRY = CompensationMethod(
    name="inverse",
    label="inverse",
    doc="K(T) and U0(T) as fitted; the device inverts K when the temperature changes.",
    short_label="inverse",
    colour="#2a9d8f",
    form=INVERSE,
    functions=_functions,
    rank=20,
)
