"""The result of a dynamic calibration as the model that the device's arithmetic is made from.

P2's errors become K = E + Gamma, U0 = df0 (accelerometers, readings in g of 9.80665 m/s^2) and
K = E + Theta, U0 = nu0 (gyros, readings in rad/s), with the temperature coefficients of (23), (24)
as slopes. D of (13) acts on the raw rate, so that G = K^-1 D is left in the compensated one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.overtemperature import OverTemperature
from triaxcal.dynamic.window import gamma_matrix
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.imu import ImuModel, constants_from_errors
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

IN_MODEL = (
    "accelerometer-bias",
    "accelerometer-matrix",
    "accelerometer-thermal",
    "gyro-bias",
    "gyro-matrix",
    "gyro-thermal",
    "g-drift",
)
"""Blocks that the device corrects."""


def left_out(layout: Layout) -> tuple[str, ...]:
    """Titles of the blocks that were estimated and that the device does not correct."""
    return tuple(b.title for b in layout.blocks if b.name not in IN_MODEL)


def imu_model(
    result: DynamicResult,
    range_degc: tuple[float, float],
    over: OverTemperature | None = None,
    gyro_range_degc: tuple[float, float] | None = None,
) -> ImuModel:
    """Model of both triads of a result, over `range_degc`; by the curves where there are some."""
    frame = result.frame
    about = frame.reference_degc, frame.gravity, range_degc
    model = model_of_states(result.layout, result.p, *about, gyro_range_degc=gyro_range_degc)
    return model if over is None else replace(model, accel=over.accel, gyro=over.gyro)


def model_of_states(
    layout: Layout,
    p: FloatArray,
    reference_degc: float,
    gravity_m_per_s2: float,
    range_degc: tuple[float, float],
    *,
    gyro_range_degc: tuple[float, float] | None = None,
) -> ImuModel:
    """Model of both triads over `range_degc`; constant where no temperature block was on.

    `gyro_range_degc` is that of the gyro's own thermometer, where it has one.

    `p`, shape (n,), are the constants of the layout in SI units, at `reference_degc`.

    Effects that belong to the table or to the signal's time (lever arms, delay, mounts, elastic
    gyro axes) are not part of it.
    """
    g = STANDARD_GRAVITY_M_PER_S2
    accel = _triad(
        layout.part(p, "accelerometer-bias")[:3] / g,
        gamma_matrix(layout.part(p, "accelerometer-matrix")),
        _slopes(layout.part(p, "accelerometer-thermal"), 1 / g),
        (reference_degc, range_degc),
    )
    theta = layout.part(p, "gyro-matrix").reshape(3, 3)
    gyro = _triad(
        layout.part(p, "gyro-bias")[:3],
        theta,
        _slopes(layout.part(p, "gyro-thermal"), 1.0),
        (reference_degc, gyro_range_degc or range_degc),
    )
    # D is per local g; the device's unit is the standard one.
    drift = layout.part(p, "g-drift").reshape(3, 3) * (g / gravity_m_per_s2)
    sensitivity: FloatArray = np.linalg.solve(np.eye(3) + theta, drift).astype(np.float64)
    return ImuModel(accel, gyro, sensitivity)


def _slopes(values: FloatArray, bias_unit: float) -> tuple[FloatArray, FloatArray]:
    """Change of bias (3,) and matrix (3, 3) with temperature, per degC."""
    return values[:3] * bias_unit, np.diag(values[3:6])


def _triad(
    bias: FloatArray,
    matrix: FloatArray,
    slopes: tuple[FloatArray, FloatArray],
    temperatures: tuple[float, tuple[float, float]],
) -> ThermalModel:
    reference, range_degc = temperatures
    constant = constants_from_errors(bias, matrix)
    slope = constants_from_errors(*slopes) - constants_from_errors(np.zeros(3), np.zeros((3, 3)))
    curves = PiecewisePolynomial(
        range_degc, (reference,), np.stack([constant, slope], axis=-1)[None]
    )
    return ThermalModel(reference, curves)
