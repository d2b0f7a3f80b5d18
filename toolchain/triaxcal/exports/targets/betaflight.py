"""Betaflight: acc_calibration, an offset in whole codes, and nothing else.

Source: src/main/sensors/acceleration.c. accADC = code - trim, and acc_1G codes are 1 g: a fixed
number of the driver. There is no scale factor, no cross term and no temperature.
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.exports.autopilot import AxisModel
from triaxcal.exports.parameters import Models, Notes, exported
from triaxcal.exports.target import Exported, Source, Target
from triaxcal.model.metrological import unpack_constants
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_LABEL = "Betaflight"
_INT16 = 2**15
_WORDS = (
    "Paste into the command line. Axes are those of the sensor after its alignment. The last",
    "number says that the accelerometer has been calibrated.",
)
_GYRO_WORDS = (
    "Nothing of the gyro: Betaflight measures its offset at each start, and has no scale for it.",
)


def _make(source: Source) -> Exported:
    accel, gyro = source.triads()
    adc = accel.adc
    if adc.bits > 16:
        raise RefusedError(
            f"{source.sensor} {source.serial}",
            f"raw codes of {adc.bits} bits",
            expected="at most 16: Betaflight's drivers give int16",
        )
    _, U0 = unpack_constants(accel.thermal.constants_at(accel.t0_degc))
    sign = np.sign(accel.per_reading)
    trim = np.rint(sign * U0 / adc.volts_per_code)
    if np.abs(trim).max() >= _INT16:
        raise RefusedError(
            f"{source.sensor} {source.serial}",
            f"an offset of {np.abs(trim).max():g} codes",
            expected="int16",
        )
    offset = (sign * trim * adc.volts_per_code * accel.per_reading)[None]
    model = AxisModel(accel.per_reading, np.ones(3), offset, accel.t0_degc, accel.range_degc)
    one_g = STANDARD_GRAVITY_M_PER_S2 / np.abs(accel.per_reading) / adc.volts_per_code
    codes = ", ".join(f"{c:.6g}" for c in one_g)
    turned = " ".join(f"{'-' * bool(s < 0)}{a}" for s, a in zip(sign, "xyz", strict=True))
    words = (*_WORDS, f"Codes of {turned}; acc_1G of the driver must be {codes}.")
    lines = [f"set acc_calibration = {','.join(f'{t:.0f}' for t in trim)},1", "save"]
    notes = Notes(_LABEL, "betaflight.txt", (*words, *(_GYRO_WORDS if gyro else ())))
    return exported(source, notes, Models(model), lines)


ENTRY = Target(
    "betaflight",
    _LABEL,
    "Offset of Betaflight, the only thing that it calibrates.",
    _make,
    rank=13,
    takes_c=False,
)
