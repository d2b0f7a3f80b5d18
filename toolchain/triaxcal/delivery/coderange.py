"""Raw codes for a unit with own-axis squares: the integers hold them over a limited acceleration.

A square of 5 mg/g^2 is 9 % of the linear result at 18 g. The format of the terms allows a quarter
of its range (docs/explanation/fixed-point.md, step R), so the larger the square, the smaller the
acceleration it is good for. Where unit.toml states no codes, they are halved until the terms fit;
the C flags a code beyond. Stated codes stay.
"""

from __future__ import annotations

from dataclasses import replace

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import sensitivities
from triaxcal.unit.description import UnitDescription

_HALVINGS = 6


def settled_codes(
    unit: UnitDescription, calibration: Calibration
) -> tuple[UnitDescription, Calibration]:
    """Unit and calibration with codes that its squares fit, and a note where they are fewer."""
    squares = calibration.squares
    adc = unit.adc
    whole = adc.code_max == 2 ** (adc.bits - 1) - 1 and adc.code_min == -(2 ** (adc.bits - 1))
    if squares is None or not squares.included or not whole:
        return unit, calibration
    from triaxcal.delivery.order import compensation_of  # noqa: PLC0415
    from triaxcal.fixedpoint.plan import make_plan  # noqa: PLC0415

    for halvings in range(_HALVINGS):
        largest = 2 ** (adc.bits - 1 - halvings)
        own = replace(unit, adc=replace(adc, code_min=-largest, code_max=largest - 1))
        try:
            make_plan(compensation_of(own, calibration, own.method), own)
        except RefusedError:
            continue
        if not halvings:
            return unit, calibration
        scale = float(sensitivities(calibration.thermal.constants_at(unit.t0_degc)).max())
        note = (
            f"the C flags raw codes beyond +-{largest} ({own.adc.largest_v / scale:.3g} g): with "
            f"own-axis squares of {squares.effect_g * 1e3:.3g} mg/g^2 its integers reach no "
            "farther; [adc] code_min and code_max choose other codes"
        )
        return own, replace(calibration, notes=(*calibration.notes, note))
    return unit, calibration
