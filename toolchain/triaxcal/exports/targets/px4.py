"""PX4: CAL_ACC0 and TC_A0 of the first accelerometer.

Source: src/modules/temperature_compensation/TemperatureCompensation.cpp and
src/lib/sensor_calibration/Accelerometer.hpp. With t = T - TREF, T clamped to TMIN and TMAX,

    a = (r - (X0 + X1 t + X2 t^2 + X3 t^3) - OFF) SCALE        m/s^2

X0 is 0 here and OFF is the offset at TREF = T0: without TC_A_ENABLE the file is right at T0.
"""

from __future__ import annotations

from triaxcal.exports.autopilot import fit_axis_model
from triaxcal.exports.parameters import AXES, Notes, exported, parameters, stored
from triaxcal.exports.target import Exported, Source, Target

_FLOAT, _INT32 = 9, 6
_LABEL = "PX4"
_WORDS = (
    "Load with QGroundControl, then restart. Of the first accelerometer. Set CAL_ACC0_ID and",
    "TC_A0_ID to the device_id that `listener sensor_accel` shows: without them PX4 ignores the",
    "rest. Axes are those of the sensor, before CAL_ACC0_ROT and SENS_BOARD_ROT.",
)


def _make(source: Source) -> Exported:
    low, high = source.fitted.calibration.range_degc
    reference = min(max(source.fitted.unit.t0_degc, low), high)
    model = stored(fit_axis_model(source.fitted, reference, 3))
    rows = {"TC_A0_TREF": reference, "TC_A0_TMIN": low, "TC_A0_TMAX": high}
    for i, axis in enumerate(AXES):
        rows[f"CAL_ACC0_{axis}OFF"] = float(model.offset[0, i])
        rows[f"CAL_ACC0_{axis}SCALE"] = float(model.scale[i])
        rows[f"TC_A0_X0_{i}"] = 0.0
        for power in range(1, 4):
            c = model.offset[power, i] if power < len(model.offset) else 0.0
            rows[f"TC_A0_X{power}_{i}"] = float(c)
    lines = [f"1\t1\tTC_A_ENABLE\t1\t{_INT32}"]
    lines += [f"1\t1\t{name}\t{text}\t{_FLOAT}" for name, text in parameters(rows).items()]
    return exported(source, Notes(_LABEL, "px4.params", _WORDS), model, lines)


ENTRY = Target(
    "px4",
    _LABEL,
    "Parameters of PX4: offset, scale, and a cubic offset over temperature.",
    _make,
    rank=12,
)
