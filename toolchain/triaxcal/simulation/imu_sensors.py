"""What the sensors of a simulated IMU would show without noise: P2 (1)-(2) and (13)-(24), exactly.

Nothing here is linearised: axes are turned, not tilted by first order, and an accelerometer feels
the force at its own proof mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_kinematics import BodyMotion, body_motion, force_at
from triaxcal.simulation.imu_motion import ImuMotion
from triaxcal.simulation.imu_truth import DEG_PER_H, PPM, ImuTruth, SecondTriad, Three


@dataclass(frozen=True)
class Moments:
    """The unit at n times.

    Attributes
    ----------
    motion : ImuMotion
    time_s : array, shape (n,)
    body : BodyMotion
        Of the instrument axes.
    """

    motion: ImuMotion
    time_s: FloatArray
    body: BodyMotion

    @classmethod
    def of(cls, truth: ImuTruth, motion: ImuMotion, time_s: FloatArray) -> Moments:
        """Of a unit on a table."""
        return cls(motion, time_s, body_motion(motion, truth.mount_elasticity_rad(), time_s))

    def warmer_k(self, truth: ImuTruth) -> FloatArray:
        """Temperature above the reference, K, shape (n,)."""
        return self.motion.temperature.at(self.time_s) - truth.reference_degc

    def gyros_warmer_k(self, truth: ImuTruth) -> FloatArray:
        """The same of the gyros."""
        own = self.motion.gyro_temperature or self.motion.temperature
        return own.at(self.time_s) - truth.reference_degc

    def force(self, place_m: FloatArray) -> FloatArray:
        """Specific force at a point of the unit given from M, m/s^2, shape (3, n)."""
        position = [place_m[:, None], np.zeros((3, 1)), np.zeros((3, 1))]
        for mounting, present in zip(self.motion.mountings, self.motion.present, strict=True):
            centre_m = 1e-3 * np.array(mounting.centre_mm)[:, None]
            if centre_m.any():
                jet = present.jet(self.time_s)
                position = [p - centre_m * jet[order] for order, p in enumerate(position)]
        lift = self.motion.lift.jet(self.time_s)
        where = (position[0], position[1], position[2])
        return force_at(self.body, self.motion.gravity_m_per_s2, lift, where)


def gyro_readings(truth: ImuTruth, at: Moments) -> FloatArray:
    """Readings of the gyros, rad/s, shape (3, n): (2), (13), (20), (24), bent characteristics."""
    warm, rate = at.gyros_warmer_k(truth), at.body.rate
    bias = DEG_PER_H * _column(truth.gyro_bias_deg_per_h)
    bias = bias + DEG_PER_H * _column(truth.gyro_bias_deg_per_h_per_k) * warm
    scale = PPM * _column(truth.gyro_scale_ppm_per_k) * warm
    drift_per_g = DEG_PER_H * np.array(truth.gyro_g_deg_per_h_per_g)
    kappa = truth.gyro_elasticity_rad()
    readings: FloatArray = truth.gyro_matrix() @ rate + scale * rate + bias
    if truth.curved is not None:
        shift, matrix = truth.curved.gyro(warm)
        readings = readings + shift + np.einsum("ijn,jn->in", matrix, rate)
    readings = readings + _bent_rate(truth, rate)
    if not (drift_per_g.any() or kappa.any()):
        return readings + rate
    force_g = at.force(np.zeros(3)) / at.motion.gravity_m_per_s2
    readings += drift_per_g @ force_g
    for i in range(3):
        readings[i] += _along_bent_axis(i, kappa, rate, force_g)
    return readings


def _bent_rate(truth: ImuTruth, rate: FloatArray) -> FloatArray:
    """What gyros with a bent characteristic read too much, rad/s, shape (3, n)."""
    deg_s = np.degrees(rate)
    size = np.abs(deg_s)
    ppm = _column(truth.gyro_asymmetry_ppm) * size
    ppm = ppm + _column(truth.gyro_even_ppm_per_deg_s) * deg_s * deg_s
    ppm = ppm + _column(truth.gyro_odd_ppm_per_deg_s) * size * deg_s
    ppm = ppm + _column(truth.gyro_cubic_ppm_per_deg2_s2) * deg_s * deg_s * deg_s
    result: FloatArray = np.radians(PPM * ppm)
    return result


def _bent_force(truth: ImuTruth, force: FloatArray, gravity: float) -> FloatArray:
    """The same of the accelerometers, m/s^2."""
    load = force / gravity
    too_much = PPM * _column(truth.accel_asymmetry_ppm) * np.abs(force)
    too_much = too_much + 1e-3 * _column(truth.accel_square_mm_per_s2_per_g2) * load * load
    result: FloatArray = (
        too_much + 1e-3 * _column(truth.accel_cubic_mm_per_s2_per_g3) * load * load * load
    )
    return result


def _along_bent_axis(
    i: int, kappa: FloatArray, rate: FloatArray, force_g: FloatArray
) -> FloatArray:
    """Rate (n,) along the sensitive axis of gyro i, which the force has bent, P2 (20)."""
    own = [i, (i + 1) % 3, (i + 2) % 3]
    about_second, about_third = kappa.T @ force_g[own]
    angle = np.hypot(about_second, about_third)
    over = np.sinc(angle / np.pi)  # sin(angle) / angle
    # The turn of the first axis about (0, a2, a3): to +2 by a3, to -3 by a2.
    first, second, third = rate[own]
    along: FloatArray = np.cos(angle) * first + over * (about_third * second - about_second * third)
    return along


def accel_readings(truth: ImuTruth, at: Moments) -> FloatArray:
    """Readings of the first accelerometer triad, m/s^2, shape (3, n): (1), (16), (23)."""
    warm = at.warmer_k(truth)
    bias = 1e-3 * _column(truth.accel_bias_mm_per_s2)
    bias = bias + 1e-3 * _column(truth.accel_bias_mm_per_s2_per_k) * warm
    scale = PPM * _column(truth.accel_scale_ppm_per_k) * warm
    matrix = truth.accel_matrix()
    if truth.curved is not None:
        shift, change = truth.curved.accel(warm)
        bias, matrix = bias + shift, matrix[:, :, None] + change
    bent = truth.accel_asymmetry_ppm, truth.accel_square_mm_per_s2_per_g2
    if np.any((*bent, truth.accel_cubic_mm_per_s2_per_g3)):
        places = 1e-3 * np.array(truth.accel_position_mm)
        own = np.stack([at.force(place)[i] for i, place in enumerate(places)])
        bias = bias + _bent_force(truth, own, at.motion.gravity_m_per_s2)
    return bias + _triad(matrix, scale, truth.accel_position_mm, at)


def second_readings(second: SecondTriad, at: Moments) -> FloatArray:
    """Readings of the second accelerometer triad, (21), m/s^2, shape (3, n)."""
    bias = 1e-3 * _column(second.bias_mm_per_s2)
    return bias + _triad(second.matrix(), np.zeros((3, 1)), second.position_mm, at)


def _triad(
    matrix: FloatArray, warm_scale: FloatArray, position_mm: tuple[Three, Three, Three], at: Moments
) -> FloatArray:
    """Three accelerometers without bias: each row of the matrix takes the force at its own mass.

    The matrix is (3, 3), or (3, 3, n) where it changes.
    """
    places = 1e-3 * np.array(position_mm)
    shared = None if places.any() else at.force(places[0])
    rows = []
    for i in range(3):
        force = at.force(places[i]) if shared is None else shared
        felt = matrix[i] @ force if matrix.ndim == 2 else (matrix[i] * force).sum(axis=0)
        rows.append(force[i] * (1.0 + warm_scale[i]) + felt)
    return np.stack(rows)


def _column(values: Three) -> FloatArray:
    return np.array(values)[:, None]
