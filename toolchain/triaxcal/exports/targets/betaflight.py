"""Betaflight: acc_calibration, an offset in whole codes, and nothing else.

Source: src/main/sensors/acceleration.c. accADC = code - trim, and acc_1G codes are 1 g: a fixed
number of the driver. There is no scale factor, no cross term and no temperature.
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.exports.autopilot import AxisModel, nominal_m_per_s2
from triaxcal.exports.parameters import Notes, exported
from triaxcal.exports.target import Exported, Source, Target
from triaxcal.model.metrological import unpack_constants

_LABEL = "Betaflight"
_INT16 = 2**15
_WORDS = (
    "Paste into the command line. Axes are those of the sensor after its alignment. The last",
    "number says that the accelerometer has been calibrated.",
)


def _make(source: Source) -> Exported:
    unit, calibration = source.fitted.unit, source.fitted.calibration
    if unit.adc.bits > 16:
        raise RefusedError(
            f"{unit.source}, adc.bits",
            f"found {unit.adc.bits}",
            expected="at most 16: Betaflight's drivers give int16",
        )
    low, high = calibration.range_degc
    _, U0 = unpack_constants(calibration.thermal.constants_at(min(max(unit.t0_degc, low), high)))
    per_reading = nominal_m_per_s2(source.fitted)
    sign = np.sign(per_reading)
    trim = np.rint(sign * U0 / unit.adc.volts_per_code)
    if np.abs(trim).max() >= _INT16:
        raise RefusedError(
            f"unit {unit.serial}", f"an offset of {np.abs(trim).max():g} codes", expected="int16"
        )
    offset = (sign * trim * unit.adc.volts_per_code * per_reading)[None]
    model = AxisModel(per_reading, np.ones(3), offset, unit.t0_degc, (low, high))
    one_g = ", ".join(f"{c:.6g}" for c in 9.80665 / np.abs(per_reading) / unit.adc.volts_per_code)
    turned = " ".join(f"{'-' * bool(s < 0)}{a}" for s, a in zip(sign, "xyz", strict=True))
    words = (*_WORDS, f"Codes of {turned}; acc_1G of the driver must be {one_g}.")
    lines = [f"set acc_calibration = {','.join(f'{t:.0f}' for t in trim)},1", "save"]
    return exported(source, Notes(_LABEL, "betaflight.txt", words), model, lines)


ENTRY = Target(
    "betaflight",
    _LABEL,
    "Offset of Betaflight, the only thing that it calibrates.",
    _make,
    rank=13,
)
