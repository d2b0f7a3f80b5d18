"""ArduPilot: INS_ACCOFFS, INS_ACCSCAL, INS_ACC1_CALTEMP and INS_TCAL1 of the first IMU.

Source: libraries/AP_InertialSensor/AP_InertialSensor_tempcal.cpp. Temperatures are clamped to TMIN
and TMAX. With P(t) = (c1 + (c2 + c3 t) t) t 1e-6,

    a = (r - P(T - 35) + P(CALTEMP - 35) - OFFS) SCAL        m/s^2, 35 degC fixed
"""

from __future__ import annotations

import numpy as np

from triaxcal.exports.autopilot import AxisModel, fit_axis_model
from triaxcal.exports.parameters import AXES, Notes, as_float32, exported, parameters, stored
from triaxcal.exports.target import Exported, Source, Target

REFERENCE_DEGC = 35.0
_PER_PARAMETER = 1e-6
_LABEL = "ArduPilot"
_WORDS = (
    "Load with a ground station, then restart. Of the first IMU; axes are those of the board,",
    "before AHRS_ORIENTATION. Do not run the accelerometer calibration afterwards.",
)


def _make(source: Source) -> Exported:
    unit = source.fitted.unit
    low, high = source.fitted.calibration.range_degc
    model = fit_axis_model(source.fitted, REFERENCE_DEGC, 3)
    cal_temp = min(max(unit.t0_degc, low), high)
    rows = {"INS_TCAL1_ENABLE": 1.0, "INS_TCAL1_TMIN": low, "INS_TCAL1_TMAX": high}
    rows["INS_ACC1_CALTEMP"] = cal_temp
    stored_model = _as_stored(model, cal_temp)
    at_cal = stored_model.offset_at(cal_temp)
    for i, axis in enumerate(AXES):
        rows[f"INS_ACCOFFS_{axis}"] = float(at_cal[i])
        rows[f"INS_ACCSCAL_{axis}"] = float(stored_model.scale[i])
        for power in range(1, 4):
            c = stored_model.offset[power, i] if power < len(stored_model.offset) else 0.0
            rows[f"INS_TCAL1_ACC{power}_{axis}"] = float(c / _PER_PARAMETER)
    lines = [f"{name},{text}" for name, text in parameters(rows).items()]
    return exported(source, Notes(_LABEL, "ardupilot.param", _WORDS), stored_model, lines)


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
    "Parameters of ArduPilot: offset, scale, and a cubic offset over temperature.",
    _make,
    rank=11,
)
