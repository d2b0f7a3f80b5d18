"""The integers of a calibration's C at mean readings of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.codegen.routines import Answers, Int32Array
from triaxcal.codegen.tryout import between_codes, corners_of, exact_codes
from triaxcal.delivery.firmware import make_firmware
from triaxcal.delivery.fitted import Fitted
from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.integer_model import (
    STATUS_TEMP_HIGH,
    STATUS_TEMP_LOW,
    apply,
    set_temperature,
)
from triaxcal.model.types import FloatArray, IntArray

_BY_INTENTION = STATUS_TEMP_LOW | STATUS_TEMP_HIGH
"""A pose half a code beyond an end of the range is clamped to it; one further is not used."""


@dataclass(frozen=True)
class InTheC:
    """What the C gives at poses.

    Attributes
    ----------
    force_g : array, shape (n, 3)
    status : array of int, shape (n,)
        Bits of `fixedpoint.integer_model`, but for the ends of the temperatures.
    """

    force_g: FloatArray
    status: IntArray


def in_the_c(fitted: Fitted, readings: FloatArray, temps_degc: FloatArray) -> InTheC:
    """Force and status by the integer model that the C equals bit for bit.

    A mean lies between two codes of the converter. The results at all codes around it are
    interpolated: a device rounds single readings, whose mean this is, and not the mean.

    Parameters
    ----------
    readings : array, shape (n, 3)
        As the converter gives them, in the unit of the calibration.
    temps_degc : array, shape (n,)
        Within the range of the calibration.

    Raises
    ------
    RefusedError
        When the calibration has no integers.
    """
    plan, unit = make_firmware(fitted).plan, fitted.unit

    def routine(temp: Int32Array, raw: Int32Array) -> Answers:
        code = temp.astype(np.int64)
        state, low_or_high = set_temperature(plan, code, np.zeros_like(code))
        accel, status = apply(plan, state, raw.astype(np.int64))
        return accel.astype(np.int32), (status | low_or_high).astype(np.uint32)

    exact = exact_codes(unit, readings, temps_degc).clip(1 - INT32_MAX, INT32_MAX - 1)
    accel, status = between_codes(routine, list(corners_of(exact)))
    return InTheC(accel * 2.0**-plan.shape.output_q, status.astype(np.int64) & ~_BY_INTENTION)
