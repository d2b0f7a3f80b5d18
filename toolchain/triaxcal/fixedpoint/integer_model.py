"""The routine in integers, vectorised: what the C must equal bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from triaxcal.fixedpoint.arithmetic import high_word, saturate_int32
from triaxcal.fixedpoint.horner import horner, segment_of
from triaxcal.fixedpoint.inversion import invert
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import linear_words, quadratic_sum
from triaxcal.fixedpoint.rate import RatePlan
from triaxcal.model.types import IntArray

STATUS_OK = 0
STATUS_TEMP_LOW = 1
STATUS_TEMP_HIGH = 2
STATUS_RAW_RANGE = 4
STATUS_SATURATED = 8
STATUS_BAD_IMAGE = 16
STATUS_RATE_RANGE = 32


@dataclass(frozen=True)
class State:
    """What set_temperature leaves for apply: gain (n, 3, 3) and offset (n, 3), int64 arrays."""

    gain: IntArray
    offset: IntArray


def set_temperature(
    plan: Plan, temp_code: IntArray, rate_code: IntArray | None = None
) -> tuple[State, IntArray]:
    """State and status of each code, shape (n,); any int32 is legal.

    `rate_code` is dT/dt in 2^-RATE_Q codes per second, shape (n,), for a plan with that term.
    """
    status = np.where(temp_code < plan.temp_min_code, STATUS_TEMP_LOW, STATUS_OK)
    status = np.where(temp_code > plan.temp_max_code, STATUS_TEMP_HIGH, status)
    code = np.clip(temp_code, plan.temp_min_code, plan.temp_max_code)
    functions = horner(plan.segments, code, segment_of(plan.segments, code)).reshape(-1, 3, 4)
    shape = plan.shape
    gain, offset = functions[:, :, :3], functions[:, :, 3]
    if shape.inverse is not None:
        gain, offset = invert(functions, shape.inverse, shape.rounding_in_offset)
    if plan.rate is not None and rate_code is not None:
        offset, flags = add_rate(plan.rate, offset, rate_code)
        status = np.bitwise_or(status, flags)
    return State(gain, offset), status


def add_rate(rate: RatePlan, offset: IntArray, rate_code: IntArray) -> tuple[IntArray, IntArray]:
    """Offsets (n, 3) with the term in dT/dt, step D, and status (n,)."""
    more, clamped = rate.offset(rate_code)
    return saturate_int32(offset + more), np.where(clamped, STATUS_RATE_RANGE, STATUS_OK)


def apply(
    plan: Plan, state: State, raw_code: IntArray, accel: IntArray | None = None
) -> tuple[IntArray, IntArray]:
    """Results (n, 3) in 2^-output_q g or deg/s, and status (n,), of raw codes (n, 3), any int32.

    A gyro's plan needs the accelerations (n, 3) that the accelerometer's gave, any int32.
    """
    shape = plan.shape
    clamped = np.clip(raw_code, shape.raw_min, shape.raw_max)
    status = np.where(_any_axis(clamped != raw_code), STATUS_RAW_RANGE, STATUS_OK)
    u = clamped << shape.raw_shift
    gain, offset = state.gain, state.offset
    if shape.high_words:
        words = high_word(gain * u[:, None, :])
        sums = words[:, :, 0] + words[:, :, 1] + words[:, :, 2] + offset
        return sums >> (shape.output_shift - 32), status
    total = np.empty_like(u)
    for i in range(3):
        total[:, i] = gain[:, i, 0] * u[:, 0] + gain[:, i, 1] * u[:, 1] + gain[:, i, 2] * u[:, 2]
    if plan.quadratic is not None:
        total += quadratic_sum(plan.quadratic, linear_words(total, offset))
    if plan.sensitivity is not None and accel is not None:
        total += accel @ plan.sensitivity.T  # step G
    if not shape.saturates and plan.quadratic is None:
        return (high_word(total) + offset) >> (shape.output_shift - 32), status
    wide = (total + (offset << 32) + shape.rounding_in_sum) >> shape.output_shift
    result = saturate_int32(wide)
    saturated = np.where(_any_axis(result != wide), STATUS_SATURATED, STATUS_OK)
    return result, np.bitwise_or(status, saturated)


def _any_axis(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """mask.any(axis=1) of a mask (n, 3), several times faster."""
    return mask[:, 0] | mask[:, 1] | mask[:, 2]
