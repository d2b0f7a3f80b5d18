"""ArduPilot: INS_ACCOFFS, INS_ACCSCAL, INS_ACC1_CALTEMP and INS_TCAL1 of the first IMU.

Of a gyro INS_GYROFFS and INS_GYR1_CALTEMP.

Source: libraries/AP_InertialSensor/AP_InertialSensor_tempcal.cpp. Temperatures are clamped to TMIN
and TMAX. With P(t) = (c1 + (c2 + c3 t) t) t 1e-6,

    a = (r - P(T - 35) + P(CALTEMP - 35) - OFFS) SCAL        m/s^2, 35 degC fixed
    w =  r - P(T - 35) + P(CALTEMP - 35) - OFFS              rad/s
"""

from __future__ import annotations

import numpy as np

from triaxcal.exports.autopilot import AxisModel, fit_axis_model, fit_gyro_offset
from triaxcal.exports.parameters import (
    AXES,
    Models,
    Notes,
    as_float32,
    exported,
    parameters,
    stored,
)
from triaxcal.exports.target import Exported, Source, Target

REFERENCE_DEGC = 35.0
_PER_PARAMETER = 1e-6
_LABEL = "ArduPilot"
_FILE = "ardupilot.param"
_WORDS = (
    "Load with a ground station, then restart. Of the first IMU; axes are those of the board,",
    "before AHRS_ORIENTATION. Do not run the accelerometer calibration afterwards.",
)
_GYRO_WORDS = (
    "INS_GYR_CAL = 0 keeps these gyro offsets. Set it to 1 and ArduPilot measures the offsets at",
    "each start, at the temperature of that moment; the curve over temperature stays in use.",
)


def _make(source: Source) -> Exported:
    accel, gyro = source.triads()
    low, high = accel.range_degc
    rows = {"INS_TCAL1_ENABLE": 1.0, "INS_TCAL1_TMIN": low, "INS_TCAL1_TMAX": high}
    model = _as_stored(fit_axis_model(accel, REFERENCE_DEGC, 3), accel.t0_degc)
    rows["INS_ACC1_CALTEMP"] = accel.t0_degc
    rows |= {f"INS_ACCSCAL_{axis}": float(s) for axis, s in zip(AXES, model.scale, strict=True)}
    rows |= _offsets(model, accel.t0_degc, "ACC")
    if gyro is None:
        return exported(source, Notes(_LABEL, _FILE, _WORDS), Models(model), _lines(rows))
    of_gyro = _as_stored(fit_gyro_offset(gyro.triad, REFERENCE_DEGC, 3), accel.t0_degc)
    rows |= {"INS_GYR_CAL": 0.0, "INS_GYR1_CALTEMP": accel.t0_degc}
    rows |= _offsets(of_gyro, accel.t0_degc, "GYR")
    notes = Notes(_LABEL, _FILE, (*_WORDS, *_GYRO_WORDS))
    return exported(source, notes, Models(model, of_gyro), _lines(rows))


def _lines(rows: dict[str, float]) -> list[str]:
    return [f"{name},{text}" for name, text in parameters(rows).items()]


def _offsets(model: AxisModel, cal_temp: float, sensor: str) -> dict[str, float]:
    """Offsets at CALTEMP, and the coefficients of their curve; `sensor` is ACC or GYR."""
    at_cal, rows = model.offset_at(cal_temp), {}
    offsets = {"ACC": "INS_ACCOFFS", "GYR": "INS_GYROFFS"}[sensor]
    for i, axis in enumerate(AXES):
        rows[f"{offsets}_{axis}"] = float(at_cal[i])
        for power in range(1, 4):
            c = model.offset[power, i] if power < len(model.offset) else 0.0
            rows[f"INS_TCAL1_{sensor}{power}_{axis}"] = float(c / _PER_PARAMETER)
    return rows


def _as_stored(model: AxisModel, cal_temp: float) -> AxisModel:
    """The model of the parameters as they are stored: OFFS, SCAL, and coefficients times 1e6."""
    made = stored(model)
    curve = as_float32(model.offset / _PER_PARAMETER) * _PER_PARAMETER
    curve[0] = 0.0
    made = AxisModel(made.per_reading, made.scale, curve, made.reference_degc, made.range_degc)
    offs = as_float32(model.offset_at(cal_temp))
    curve = np.array(curve)
    curve[0] = offs - made.offset_at(cal_temp)
    return AxisModel(made.per_reading, made.scale, curve, made.reference_degc, made.range_degc)


ENTRY = Target(
    "ardupilot",
    _LABEL,
    "Parameters of ArduPilot: offset, scale, cubic offsets over temperature, gyro offsets.",
    _make,
    rank=11,
    takes_c=False,
)
