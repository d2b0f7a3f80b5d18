"""A gyro triad in integers: the accelerometer's arithmetic, and a g-sensitivity, step G.

Source: docs/explanation/fixed-point.md, step G; P2 (2), (13).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import round_half_up
from triaxcal.fixedpoint.plan import Plan, Triad, triad_plan
from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.methods.imu import ImuCompensation
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.unit.adc import Adc
from triaxcal.unit.arithmetic import PORTABLE
from triaxcal.unit.prefix import DEFAULT_PREFIX
from triaxcal.unit.thermometer import TemperatureSensor

SENSITIVITY_LIMIT = 2**29
"""A row's words sum to this at most: the largest int32 of specific force then comes to 1/8 of the
range of int32."""

SENSITIVITY_NAMES = tuple(f"G{axis}{force}" for axis in AXES for force in AXES)
"""Names of the nine words, in image order."""


@dataclass(frozen=True)
class TriadDescription:
    """A triad of an IMU: its converter ("V" is the unit of the readings) and its result's LSB."""

    name: str
    adc: Adc
    temperature_sensor: TemperatureSensor
    output_q: int
    prefix: str = DEFAULT_PREFIX
    arithmetic: str = PORTABLE


def make_gyro_plan(imu: ImuCompensation, unit: Triad, accel_q: int) -> Plan:
    """Integers of the gyro, whose result is in 2^-output_q deg/s; `accel_q` the accelerometer's.

    Raises
    ------
    RefusedError
        When no format holds: names the input range, the coefficient or the g-sensitivity.
    """
    form = imu.gyro.form
    curves = imu.gyro.curves
    per_degree = np.ones(12)
    if form == "direct":
        per_degree *= 180.0 / np.pi
    else:
        per_degree[:9] = np.pi / 180.0
    coefficients = curves.coefficients * per_degree[None, :, None]
    in_degrees = PiecewisePolynomial(curves.breaks_degc, curves.origins_degc, coefficients)
    plan = triad_plan(replace(imu.gyro, curves=in_degrees), unit, gyro=True)
    plan = replace(plan, force_q=accel_q)
    return _with_sensitivity(plan, imu.g_sensitivity * (180.0 / np.pi), f"unit {unit.name}")


def sensitivity_log2(plan: Plan) -> int:
    """A word is -G times 2 to this, for G in (deg/s)/g: it multiplies accelerations."""
    return plan.shape.output_q + plan.shape.output_shift - plan.force_q


def _with_sensitivity(plan: Plan, per_g: FloatArray, where: str) -> Plan:
    log2 = sensitivity_log2(plan)
    real = -per_g * 2.0**log2
    if not np.isfinite(real).all():
        raise RefusedError(where, "a g-sensitivity is not a finite number")
    words = np.array([[round_half_up(v) for v in row] for row in real.tolist()], dtype=object)
    sums = [sum(abs(v) for v in row) for row in words]
    if max(sums) > SENSITIVITY_LIMIT:
        row = sums.index(max(sums))
        raise RefusedError(
            where,
            f"g-sensitivities of axis {AXES[row]} sum to {np.abs(per_g[row]).sum():.4g} (deg/s)/g",
            expected=f"at most {SENSITIVITY_LIMIT / 2.0**log2:.4g} for the formats chosen",
            remedy="check its unit, (rad/s)/g, and the fit",
        )
    return replace(plan, sensitivity=words.astype(np.int64), real_sensitivity=real)
