"""The C of one IMU: the functions of both triads, proven and checked against Python."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.imu import ImuBuild, build_imu
from triaxcal.delivery.fittedimu import FittedImu
from triaxcal.dynamic.device import Device
from triaxcal.fixedpoint.gyro import TriadDescription
from triaxcal.model.curves import ThermalModel
from triaxcal.model.methods.compensation import Compensation
from triaxcal.model.methods.imu import ImuCompensation, ImuModel, compensate_imu
from triaxcal.model.metrological import exact_gain_and_offset, worst_force_error_g
from triaxcal.model.types import FloatArray
from triaxcal.unit.adc import Adc

METHOD = "matrix"
ACCEL_MODEL_ERROR_MAX_G = 1e-6
GYRO_MODEL_ERROR_MAX_DEG_PER_H = 0.01
"""How far N(T) may be from K(T)^-1: a tilter's default, and what P2 demands of a gyro drift."""


@dataclass(frozen=True)
class ImuC:
    """The C of an IMU and what was shown of it.

    Attributes
    ----------
    fitted : FittedImu
    build : ImuBuild
    accel_model_error_g, gyro_model_error_deg_per_h : float
        Largest error of the functions that the device evaluates against K(T)^-1 (U - U0(T)), at
        any temperature code and any raw code.
    """

    fitted: FittedImu
    build: ImuBuild
    accel_model_error_g: float
    gyro_model_error_deg_per_h: float

    @property
    def device(self) -> Device:
        """What the codes of the firmware are."""
        return self.fitted.device

    @property
    def model(self) -> ImuModel:
        """The fitted constants over temperature."""
        return self.fitted.model

    @property
    def accel_error_g(self) -> float:
        """Largest error against the fitted model: that of the arithmetic and of the functions."""
        arithmetic = self.build.accel_bound.lsb * 2.0**-self.build.accel.shape.output_q
        return arithmetic + self.accel_model_error_g

    @property
    def gyro_arithmetic_error_deg_per_h(self) -> float:
        """Proven error of the arithmetic, with what the accelerometer carries over."""
        return max(self.build.rate_bound_lsb) * 2.0**-self.build.gyro.shape.output_q * 3600

    @property
    def gyro_error_deg_per_h(self) -> float:
        """The same of the gyro, the accelerometer's errors carried over."""
        return self.gyro_arithmetic_error_deg_per_h + self.gyro_model_error_deg_per_h


def imu_c(fitted: FittedImu) -> ImuC:
    """The C of a calibrated IMU, proven and checked.

    Raises
    ------
    RefusedError
        As `build_imu`, and when the functions miss the fitted model.
    """
    device, model = fitted.device, fitted.model
    adcs = device.accel_adc, device.gyro_adc
    limits = ACCEL_MODEL_ERROR_MAX_G, math.radians(GYRO_MODEL_ERROR_MAX_DEG_PER_H / 3600)
    functions = compensate_imu(
        model,
        METHOD,
        device.range_degc,
        (adcs[0].largest_v, adcs[1].largest_v),
        limits,
        gyro_range_degc=device.gyro_range,
    )
    name, sensors = fitted.name, (device.temperature_sensor, device.gyro_temperature_sensor)
    triads = (
        TriadDescription(
            name, adcs[0], sensors[0], device.accel_q, device.prefix, device.arithmetic
        ),
        TriadDescription(
            name, adcs[1], sensors[1], device.gyro_rate_q, device.prefix, device.arithmetic
        ),
    )
    build = build_imu(
        functions,
        triads,
        fitted.provenances,
        two_thermometers=device.two_thermometers,
        choice=device.angles,
    )
    errors = _model_errors(model, functions, device, build)
    _refuse_model_errors(fitted.source, errors)
    return ImuC(fitted, build, *errors)


def _model_errors(
    model: ImuModel, functions: ImuCompensation, device: Device, build: ImuBuild
) -> tuple[float, float]:
    """In g and in deg/h; the accelerometer's passes to the gyro through the g-sensitivity."""
    temps, gyro_temps = (
        plan.temp_codes.astype(np.float64) * sensor.degc_per_code + sensor.degc_at_zero
        for plan, sensor in (
            (build.accel, device.temperature_sensor),
            (build.gyro, device.gyro_temperature_sensor),
        )
    )
    accel = _triad_error(model.accel, functions.accel, temps, device.accel_adc)
    gyro = _triad_error(model.gyro, functions.gyro, gyro_temps, device.gyro_adc)
    carried = accel.max(axis=0) if device.two_thermometers else accel
    gyro = gyro + carried @ np.abs(model.g_sensitivity).T
    return float(accel.max()), float(np.rad2deg(gyro.max()) * 3600)


def _triad_error(
    thermal: ThermalModel, functions: Compensation, temps: FloatArray, adc: Adc
) -> FloatArray:
    exact = exact_gain_and_offset(thermal.constants_at(temps))
    return worst_force_error_g(functions.gain_and_offset(temps), exact, adc.largest_v)


def _refuse_model_errors(source: str, errors: tuple[float, float]) -> None:
    """The order of N(T) is chosen on a grid; what counts is every temperature code."""
    for what, error, limit, name in (
        ("accelerometer", errors[0] * 1e6, ACCEL_MODEL_ERROR_MAX_G * 1e6, "micro-g"),
        ("gyro", errors[1], GYRO_MODEL_ERROR_MAX_DEG_PER_H, "deg/h"),
    ):
        if error > limit:
            raise RefusedError(
                f"{source}, [device] range_degc",
                f"N(T) of the {what} is {error:.4g} {name} off the fitted model",
                expected=f"at most {limit:g} {name}",
                remedy="narrow the range, or check the temperature coefficients",
            )
