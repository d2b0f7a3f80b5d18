"""Recordings of an IMU that does not exist, sampled from exact physics, with noise and counts.

Increments are integrals of the readings over each interval, by Gauss-Legendre quadrature with
three nodes. They are integrals along the turning axes, as a rate-integrating sensor makes them:
coning and sculling are in them and are not corrected for. Nothing is remembered from one interval
to the next but the noise, so a recording of any length is made in pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_kinematics import rippled
from triaxcal.simulation.imu_motion import ImuMotion
from triaxcal.simulation.imu_noise import (
    ACCEL,
    GYRO_TEMPERATURE,
    SECOND,
    TABLE,
    TEMPERATURE,
    Channel,
    white,
)
from triaxcal.simulation.imu_sensors import Moments, accel_readings, gyro_readings, second_readings
from triaxcal.simulation.imu_truth import ARCSEC, ImuTruth

PIECE = 1 << 12
"""Samples made at once: their arrays stay in the cache."""


def simulate_imu(truth: ImuTruth, motion: ImuMotion, rate_hz: float, seed: int) -> ImuRecording:
    """Recording of a unit on a table; each reading of its pieces makes them anew, all the same.

    The samples are at 1/rate, 2/rate, ... to the end of the motion. The table's angle is recorded
    when the motion's table reads it.
    """
    count = round(motion.duration_s * rate_hz)
    if count < 1:
        raise ValueError(f"no sample at {rate_hz:g} Hz in {motion.duration_s:g} s")
    return ImuRecording(
        name=f"simulation, seed {seed}",
        pieces=lambda: _pieces(truth, motion, rate_hz, seed, count),
        rate_hz=rate_hz,
        latitude_deg=motion.latitude_deg,
        gravity_m_per_s2=motion.gravity_m_per_s2,
        rate_convention=truth.rate_convention,
        force_convention=truth.force_convention,
        table=motion.turntable() if motion.table.reads_angle else None,
    )


def _pieces(
    truth: ImuTruth, motion: ImuMotion, rate_hz: float, seed: int, count: int
) -> Iterator[ImuSamples]:
    step_s = 1.0 / rate_hz
    gyro = Channel.gyros(truth, step_s, seed)
    accel = Channel.accelerometers(truth, step_s, seed, ACCEL)
    second = Channel.accelerometers(truth, step_s, seed, SECOND)
    temp, table = white(seed, TEMPERATURE), white(seed, TABLE)
    gyro_temp = white(seed, GYRO_TEMPERATURE)
    for start in range(0, count, PIECE):
        time_s = np.arange(start + 1, min(start + PIECE, count) + 1) / rate_hz
        rate, force, force2 = _ideal(truth, motion, time_s, step_s)
        thermometer = truth.noise.temp_sd_degc * temp.standard_normal(len(time_s))
        gyro_degc = None
        if motion.gyro_temperature is not None:
            gyro_degc = motion.gyro_temperature.at(time_s)
            gyro_degc += truth.noise.temp_sd_degc * gyro_temp.standard_normal(len(time_s))
        angle = None
        if motion.table.reads_angle:
            sd = ARCSEC * truth.noise.table_sd_arcsec
            angle = rippled(motion.table, motion.table_angle.jet(time_s))[0]
            angle = angle + sd * table.standard_normal(len(time_s))
        yield ImuSamples(
            time_s=time_s,
            rate=gyro.read(rate),
            force=accel.read(force),
            temp_degc=motion.temperature.at(time_s) + thermometer,
            force2=None if force2 is None else second.read(force2),
            table_angle_rad=angle,
            gyro_temp_degc=gyro_degc,
        )


def _ideal(
    truth: ImuTruth, motion: ImuMotion, time_s: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Readings without noise of gyros, accelerometers and the second triad, each (n, 3)."""
    moments: dict[tuple[str, float], Moments] = {}

    def sampled(
        convention: str, lag_ms: float, readings_of: Callable[[Moments], FloatArray]
    ) -> FloatArray:
        if (convention, lag_ms) not in moments:
            nodes_s = _nodes(time_s - 1e-3 * lag_ms, step_s, convention)
            moments[convention, lag_ms] = Moments.of(truth, motion, nodes_s)
        readings = readings_of(moments[convention, lag_ms])
        if convention != INCREMENT:
            return readings.T
        by_node = readings.reshape(3, len(_NODES), len(time_s))
        integral: FloatArray = step_s * np.tensordot(_WEIGHTS, by_node, (0, 1)).T
        return integral

    rate = sampled(truth.rate_convention, 0.0, partial(gyro_readings, truth))
    force = sampled(truth.force_convention, truth.accel_delay_ms, partial(accel_readings, truth))
    if truth.second is None:
        return rate, force, None
    second = partial(second_readings, truth.second)
    return rate, force, sampled(truth.force_convention, truth.second.delay_ms, second)


_ROOTS, _LEGENDRE = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = (_ROOTS - 1.0) / 2.0, _LEGENDRE / 2.0
"""On the interval (-1, 0) that ends at a sample."""


def _nodes(time_s: FloatArray, step_s: float, convention: str) -> FloatArray:
    """Times at which the readings are needed, node after node of all the samples."""
    if convention != INCREMENT:
        return time_s
    return np.concatenate([time_s + node * step_s for node in _NODES])
