"""PX4: CAL_ACC0 and TC_A0 of the first accelerometer, CAL_GYRO0 and TC_G0 of the first gyro.

Source: src/modules/temperature_compensation/TemperatureCompensation.cpp and
src/lib/sensor_calibration/Accelerometer.hpp, Gyroscope.hpp. With t = T - TREF,
T clamped to TMIN and TMAX,

    a = (r - (X0 + X1 t + X2 t^2 + X3 t^3) - OFF) SCALE        m/s^2
    w =  r - (X0 + X1 t + X2 t^2 + X3 t^3) - OFF               rad/s

X0 is 0 here and OFF is the offset at TREF = T0: without TC_A_ENABLE the file is right at T0.
"""

from __future__ import annotations

from triaxcal.exports.autopilot import AxisModel, fit_axis_model, fit_gyro_offset
from triaxcal.exports.parameters import AXES, Models, Notes, exported, parameters, stored
from triaxcal.exports.target import Exported, Source, Target

_FLOAT, _INT32 = 9, 6
_LABEL = "PX4"
_FILE = "px4.params"
_WORDS = (
    "Load with QGroundControl, then restart. Of the first accelerometer. Set CAL_ACC0_ID and",
    "TC_A0_ID to the device_id that `listener sensor_accel` shows: without them PX4 ignores the",
    "rest. Axes are those of the sensor, before CAL_ACC0_ROT and SENS_BOARD_ROT.",
)
_GYRO_WORDS = (
    "The same of CAL_GYRO0_ID, TC_G0_ID and `listener sensor_gyro`. Do not run the gyro",
    "calibration afterwards: it replaces CAL_GYRO0.",
)


def _make(source: Source) -> Exported:
    accel, gyro = source.triads()
    reference = accel.t0_degc
    model = stored(fit_axis_model(accel, reference, 3))
    lines = [f"1\t1\tTC_A_ENABLE\t1\t{_INT32}"]
    scales = {f"CAL_ACC0_{axis}SCALE": float(s) for axis, s in zip(AXES, model.scale, strict=True)}
    lines += _lines(_offsets(model, "ACC", "A") | scales)
    if gyro is None:
        return exported(source, Notes(_LABEL, _FILE, _WORDS), Models(model), lines)
    of_gyro = stored(fit_gyro_offset(gyro.triad, reference, 3))
    lines.append(f"1\t1\tTC_G_ENABLE\t1\t{_INT32}")
    lines += _lines(_offsets(of_gyro, "GYRO", "G"))
    notes = Notes(_LABEL, _FILE, (*_WORDS, *_GYRO_WORDS))
    return exported(source, notes, Models(model, of_gyro), lines)


def _lines(rows: dict[str, float]) -> list[str]:
    return [f"1\t1\t{name}\t{text}\t{_FLOAT}" for name, text in parameters(rows).items()]


def _offsets(model: AxisModel, sensor: str, letter: str) -> dict[str, float]:
    """Offsets at TREF and their curve: CAL_<sensor>0 and TC_<letter>0."""
    low, high = model.range_degc
    curve = f"TC_{letter}0"
    rows = {f"{curve}_TREF": model.reference_degc, f"{curve}_TMIN": low, f"{curve}_TMAX": high}
    for i, axis in enumerate(AXES):
        rows[f"CAL_{sensor}0_{axis}OFF"] = float(model.offset[0, i])
        rows[f"{curve}_X0_{i}"] = 0.0
        for power in range(1, 4):
            c = model.offset[power, i] if power < len(model.offset) else 0.0
            rows[f"{curve}_X{power}_{i}"] = float(c)
    return rows


ENTRY = Target(
    "px4",
    _LABEL,
    "Parameters of PX4: offset, scale, cubic offsets over temperature, gyro offsets.",
    _make,
    rank=12,
    takes_c=False,
)
