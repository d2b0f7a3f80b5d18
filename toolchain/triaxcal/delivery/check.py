"""The integers of a calibration's C at mean readings of poses."""

from __future__ import annotations

import numpy as np

from triaxcal.delivery.firmware import make_firmware
from triaxcal.delivery.fitted import Fitted
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.types import FloatArray, IntArray


def integer_force_g(fitted: Fitted, readings: FloatArray, temps_degc: FloatArray) -> FloatArray:
    """Force (n, 3), g, by the integer model that the C equals bit for bit.

    A mean lies between two codes of the converter. The results at both are interpolated, axis by
    axis: a device rounds single readings, whose mean this is, and not the mean.

    Parameters
    ----------
    readings : array, shape (n, 3)
        As the converter gives them, in the unit of the calibration.
    temps_degc : array, shape (n,)

    Raises
    ------
    RefusedError
        When the calibration has no integers.
    """
    plan, unit = make_firmware(fitted).plan, fitted.unit
    codes = readings / unit.adc.volts_per_code
    whole = np.floor(codes).clip(unit.adc.code_min, unit.adc.code_max - 1).astype(np.int64)
    sensor = unit.temperature_sensor
    temps = np.array([sensor.code(t) for t in temps_degc.tolist()], dtype=np.int64)
    result = _run(plan, temps, whole)
    for axis in range(3):
        step = np.zeros(3, dtype=np.int64)
        step[axis] = 1
        change = _run(plan, temps, whole + step) - _run(plan, temps, whole)
        result += change * (codes - whole)[:, [axis]]
    return result * 2.0**-plan.shape.output_q


def _run(plan: Plan, temps: IntArray, raw: IntArray) -> FloatArray:
    state, _ = set_temperature(plan, temps, np.zeros_like(temps))
    return apply(plan, state, raw)[0].astype(np.float64)
