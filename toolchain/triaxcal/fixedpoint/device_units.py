"""The float model in the units of the device: temperature codes, x of a segment, raw LSB."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.horner import Segment
from triaxcal.model.methods.compensation import Compensation
from triaxcal.model.methods.method import INVERSE
from triaxcal.model.types import FloatArray
from triaxcal.unit.thermometer import TemperatureSensor

MAX_TEMPERATURE_CODES = 2**17
"""Proof and cross-check visit every temperature code: this many take some seconds."""

ROWS = tuple(3 * i + j if j < 3 else 9 + i for i in range(3) for j in range(4))
"""Where each function of the image's order (row by row: three of the matrix, then the offset)
stands in the order of `CONSTANT_NAMES`."""


def temperature_codes(
    compensation: Compensation, sensor: TemperatureSensor, where: str
) -> tuple[int, int]:
    """First and last code of the range of a compensation.

    Raises
    ------
    RefusedError
        When there is none, too many, or one does not fit int32.
    """
    low, high = compensation.curves.breaks_degc[0], compensation.curves.breaks_degc[-1]
    # A range end that is a code but for rounding counts as that code.
    codes = [(t - sensor.degc_at_zero) / sensor.degc_per_code for t in (low, high)]
    first, last = int(np.ceil(codes[0] - 1e-6)), int(np.floor(codes[1] + 1e-6))
    if last < first:
        raise RefusedError(
            where,
            f"no temperature code lies in {low:g} to {high:g} degC: "
            f"temperature_sensor.degc_per_code = {sensor.degc_per_code:g}",
            remedy="check temperature_sensor, or widen thermal.range_degc",
        )
    if last - first >= MAX_TEMPERATURE_CODES:
        raise RefusedError(
            where,
            f"temperature_sensor.degc_per_code = {sensor.degc_per_code:g} makes "
            f"{last - first + 1} codes of {low:g} to {high:g} degC",
            expected=f"at most {MAX_TEMPERATURE_CODES}, because the proof checks each of them",
            remedy="drop the lowest bits of the temperature code in the driver and enlarge "
            "degc_per_code accordingly",
        )
    if max(abs(first), abs(last)) > INT32_MAX // 2:
        raise RefusedError(
            where,
            f"temperature codes {first} to {last} do not fit int32 with a bit to spare",
            remedy="check temperature_sensor.degc_per_code and degc_at_zero",
        )
    return first, last


def device_polynomials(
    compensation: Compensation,
    sensor: TemperatureSensor,
    output_q: int,
    codes: tuple[int, int],
    volts_per_lsb: float,
) -> tuple[FloatArray, list[Segment]]:
    """Real polynomials in x, in device units, and the frames (integers still zero) they live in.

    Direct: N in 2^-(output_q + 32) g per raw LSB, b in 2^-output_q g.
    Inverse: K in raw LSB per g, U0 in raw LSB.
    """
    curves, (low, high) = compensation.curves, codes
    breaks = [(t - sensor.degc_at_zero) / sensor.degc_per_code for t in curves.breaks_degc]
    firsts = [low, *(int(np.ceil(b - 1e-6)) for b in breaks[1:-1]), high + 1]
    frames, rows = [], []
    scale = np.empty(12)
    if compensation.form == INVERSE:
        scale[:] = 1.0 / volts_per_lsb
    else:
        scale[:9] = volts_per_lsb * 2.0 ** (output_q + 32)
        scale[9:] = 2.0**output_q
    for s in range(len(curves.origins_degc)):
        first, last = firsts[s], firsts[s + 1] - 1
        if last < first:
            continue
        origin = (first + last + 1) // 2
        gain_log2 = 31 - max(1, origin - first).bit_length()
        middle = sensor.degc(origin) - curves.origins_degc[s]
        half = sensor.degc_per_code * 2.0 ** (31 - gain_log2)
        in_x = _substitute(curves.coefficients[s], middle, half)
        frames.append(Segment(first, origin, 1 << gain_log2, np.zeros(in_x.shape, np.int64)))
        rows.append((in_x * scale[:, None])[list(ROWS)])
    return np.array(rows), frames


def _substitute(coefficients: FloatArray, middle: float, half: float) -> FloatArray:
    """Coefficients in x of polynomials in dT = middle + half x; shape (functions, order + 1)."""
    order = coefficients.shape[1] - 1
    result = np.zeros_like(coefficients)
    for n in range(order, -1, -1):
        shifted = np.zeros_like(result)
        shifted[:, 1:] = result[:, :-1] * half
        result = result * middle + shifted
        result[:, 0] += coefficients[:, n]
    return result
