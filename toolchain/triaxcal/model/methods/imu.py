"""A whole IMU: an accelerometer triad and a gyro triad, P2 (1), (2), (13), in floats.

Accelerometer and gyro are triads of one form, U = K(T) a + U0(T) and U = K(T) w + U0(T). P2 writes
them as errors of readings that are already in physical units,

    f' - f = df0 + Gamma f          K = E + Gamma, U0 = df0
    w' - w = nu0 + Theta w          K = E + Theta, U0 = nu0

so for a digital unit "V" is the unit of its nominal reading: U is a in g, or w in rad/s, by the
data sheet's scale. The device then computes, with a the compensated specific force in g,

    w = K(T)^-1 (U - U0(T)) - G a
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.curves import ThermalModel
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.metrological import pack_constants
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class ImuModel:
    """The fitted constants of both triads over temperature: what a dynamic calibration gives.

    Attributes
    ----------
    accel : ThermalModel
        Twelve functions: K row by row in V/g, then U0 in V (`constants_from_errors`).
    gyro : ThermalModel
        Twelve functions: K row by row in V/(rad/s), then U0 in V.
    g_sensitivity : array, shape (3, 3)
        G in (rad/s)/g: gyro axes x, y, z by the axes of specific force. It is what remains in the
        compensated rate: where P2 (13) adds D f to w' itself, G is K^-1 D, in practice D.
    accel_terms : Terms
        Quadratic and dT/dt terms of the accelerometer.
    """

    accel: ThermalModel
    gyro: ThermalModel
    g_sensitivity: FloatArray
    accel_terms: Terms = NO_TERMS

    def __post_init__(self) -> None:
        if self.g_sensitivity.shape != (3, 3):
            raise ValueError("the g-sensitivity has three rows of three")


@dataclass(frozen=True)
class ImuCompensation:
    """What the device evaluates for both triads.

    Attributes
    ----------
    accel : Compensation
        Functions in g.
    gyro : Compensation
        Functions in rad/s, over the temperatures of its own thermometer.
    g_sensitivity : array, shape (3, 3)
        G in (rad/s)/g.
    """

    accel: Compensation
    gyro: Compensation
    g_sensitivity: FloatArray

    def __call__(
        self, accel_v: FloatArray, gyro_v: FloatArray, temp_degc: FloatArray | float
    ) -> tuple[FloatArray, FloatArray]:
        """Specific force in g and angular rate in rad/s, each (..., 3), of readings in V.

        At one temperature of both.
        """
        force_g = self.accel.evaluate(accel_v, temp_degc)
        rate = self.gyro.evaluate(gyro_v, temp_degc) - force_g @ self.g_sensitivity.T
        return force_g, rate


def constants_from_errors(bias: FloatArray, matrix: FloatArray) -> FloatArray:
    """Twelve constants (..., 12) of P2's errors: bias (..., 3) and Gamma or Theta (..., 3, 3).

    Being linear, it also turns the coefficients of a thermal polynomial, but that E belongs to its
    constant term only: subtract `constants_from_errors(zeros, zeros)` from the others.
    """
    return pack_constants(np.eye(3) + matrix, bias)


def compensate_imu(
    model: ImuModel,
    method: str,
    range_degc: tuple[float, float],
    readings_max_v: tuple[float, float],
    errors_max: tuple[float, float],
    *,
    gyro_range_degc: tuple[float, float] | None = None,
) -> ImuCompensation:
    """Functions that the device evaluates; pairs are of accelerometer (g) and gyro (rad/s).

    As `compensate` for each triad by the same method. `gyro_range_degc` is that of the gyro's own
    thermometer, where it has one.
    """
    accel = compensate(
        model.accel,
        method,
        range_degc,
        readings_max_v[0],
        errors_max[0],
        terms=model.accel_terms,
    )
    own = range_degc if gyro_range_degc is None else gyro_range_degc
    gyro = compensate(model.gyro, method, own, readings_max_v[1], errors_max[1])
    return ImuCompensation(accel, gyro, model.g_sensitivity)


EXAMPLE_SENSITIVITY = np.deg2rad(0.02) * np.array(
    [[1.0, -0.3, 0.2], [0.4, 0.9, -0.1], [0.0, 0.25, -1.2]]
)
"""MEMS: some hundredths of a deg/s for 1 g; what the C of a gyro is tried on."""
