"""The delivered C of an IMU against exact physics, at temperatures that were not recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dynamic_cases import UNIT_TOML, table_of, write_unit
from triaxcal.codegen.routines import GeneratedImu, start_generated_imu
from triaxcal.delivery.imu import ImuDelivery, deliver_imu
from triaxcal.delivery.imuc import ImuC
from triaxcal.dynamic.blocks.base import LOWER
from triaxcal.dynamic.recording import INSTANT, ImuRecording
from triaxcal.dynamic.thermalbasis import GROUPS, OF_GYROS
from triaxcal.dynamic.thermalcurves import covariance_at
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_motion import ImuMotion, Mounting, Move
from triaxcal.simulation.imu_sensors import Moments, accel_readings, gyro_readings
from triaxcal.simulation.imu_temperature import TemperatureDrift
from triaxcal.simulation.imu_truth import ImuTruth

G = 9.80665
DEVICE = """\
[device]
accel_bits = 21
accel_full_scale_g = 10.48576
gyro_bits = 20
gyro_full_scale_deg_per_s = 500
degc_per_code = 0.125
range_degc = [-40, 85]
"""
FAST = (Move(720.0, 200.0, 2.0), Move(-90.0, 60.0, 2.0), Move(-720.0, 200.0, 2.0))
REST_RAD_PER_S = np.radians(0.05)


def toml_of(files: list[str], device: str = DEVICE, more: str = "") -> str:
    recordings = "".join(f'[[dynamic.recording]]\nfile = "{name}"\n' for name in files)
    own = 'gyro_temp_column = "gyro_temp_degc"\n' * ("gyro_degc_per_code" in device)
    toml = UNIT_TOML.replace('recording = "recording.csv"\n', "").replace(
        "[noise]", f'temp_column = "temp_degc"\n{own}{recordings}[noise]'
    )
    return toml + device + more


def folder_of(
    base: Path, recordings: list[ImuRecording], device: str = DEVICE, more: str = ""
) -> Path:
    """Folder of a unit with several recordings."""
    files = ["recording.csv", *(f"{k}.csv" for k in range(1, len(recordings)))]
    unit = write_unit(base / "IMU", table_of(recordings[0]), toml_of(files, device, more))
    for k, recording in enumerate(recordings[1:], start=1):
        other = write_unit(base / f"other{k}", table_of(recording))
        (other / "recording.csv").rename(unit / f"{k}.csv")
    return unit


@dataclass(frozen=True)
class Ran:
    """A delivery and its C, compiled from the delivered files."""

    truth: ImuTruth
    unit: Path
    made: ImuDelivery
    c: ImuC
    generated: GeneratedImu


def delivered(
    base: Path, truth: ImuTruth, recordings: list[ImuRecording], device: str = DEVICE
) -> Ran:
    unit = folder_of(base, recordings, device)
    made = deliver_imu(unit)
    assert made.c is not None
    for name, content in made.c.build.files.items():
        (base / name).write_bytes(content)
    generated = GeneratedImu(start_generated_imu(base, base).load())
    return Ran(truth, unit, made, made.c, generated)


@dataclass(frozen=True)
class Answers:
    """Errors of the C in a motion at one temperature, and what was said of them.

    Attributes
    ----------
    resting : array of bool, shape (n,)
    accel, rate : arrays, shape (n, 3)
        Error, g and rad/s.
    accel_sd, rate_sd : arrays, shape (n, 3)
        By the stated covariance of the constants.
    accel_least, rate_least : floats
        Half a code of the readings and the proven error of the C.
    """

    resting: np.ndarray
    accel: FloatArray
    rate: FloatArray
    accel_sd: FloatArray
    rate_sd: FloatArray
    accel_least: float
    rate_least: float


def fast_motion(degc: float, gyro_degc: float | None = None) -> ImuMotion:
    """Rests and turns at up to 200 deg/s about each axis, at one temperature of each triad."""
    own = None if gyro_degc is None else TemperatureDrift(gyro_degc, gyro_degc)
    return ImuMotion(
        tuple(Mounting(FAST, 4.0) for _ in range(3)),
        temperature=TemperatureDrift(degc, degc),
        gyro_temperature=own,
    )


def judged_c(ran: Ran, degc: float, gyro_degc: float | None = None) -> Answers:
    """What the C makes of readings without noise, from a motion that no recording has."""
    truth = replace(ran.truth, rate_convention=INSTANT, force_convention=INSTANT)
    motion = fast_motion(degc, gyro_degc)
    at = Moments.of(truth, motion, np.arange(0.0, motion.duration_s, 0.05))
    force, rate = at.force(np.zeros(3)).T / G, at.body.rate.T
    device = ran.c.device
    lsb = device.accel_adc.volts_per_code, device.gyro_adc.volts_per_code
    readings = accel_readings(truth, at).T / G, gyro_readings(truth, at).T
    accel, gyro = (np.rint(r / v).astype(np.int32) for r, v in zip(readings, lsb, strict=True))
    gyro_degc = degc if gyro_degc is None else gyro_degc
    temp, gyro_temp = (
        np.full(len(force), sensor.code(t), np.int32)
        for sensor, t in (
            (device.temperature_sensor, degc),
            (device.gyro_temperature_sensor, gyro_degc),
        )
    )
    raw = np.ascontiguousarray(accel), np.ascontiguousarray(gyro)
    _, (found, turned, status) = ran.generated.run(None, temp, *raw, gyro_temp)
    assert not status.any()
    accel_sd, rate_sd = stated_sd(ran, (degc, gyro_degc), force, rate)
    return Answers(
        np.linalg.norm(rate, axis=1) < REST_RAD_PER_S,
        found * 2.0**-device.accel_q - force,
        np.deg2rad(turned * 2.0**-device.gyro_rate_q) - rate,
        accel_sd,
        rate_sd,
        # |K^-1| rows sum to less than 1.1.
        0.55 * lsb[0] + ran.c.accel_error_g,
        0.55 * lsb[1] + float(np.deg2rad(ran.c.gyro_error_deg_per_h / 3600)),
    )


def stated_sd(
    ran: Ran, temps_degc: tuple[float, float], force_g: FloatArray, rate: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (n, 3), g and rad/s, of the covariance that the delivery states.

    The chosen functions have correlations; each constant is widened to the standard deviation that
    is stated of it, which has what other functions differ.
    """
    over = ran.made.done.over
    assert over is not None
    fit, known = over.choice.fit, over.known
    start, variances = 0, []
    for block, signal in zip(GROUPS, (None, force_g * G, None, rate), strict=True):
        count = len(block.states)
        gyro = block.name in OF_GYROS
        degc, grid = temps_degc[gyro], known.gyro_temps_degc if gyro else known.temps_degc
        own = covariance_at(fit, block, np.array([degc]), None)[0]  # type: ignore[arg-type]
        sd = np.array([np.interp(degc, grid, known.sd[:, start + k]) for k in range(count)])
        wider = sd / np.sqrt(np.diag(own))
        C = own * np.outer(wider, wider)
        start += count
        if signal is None:
            variances.append(np.broadcast_to(np.diag(C), (len(rate), 3)))
            continue
        elements = LOWER if count == len(LOWER) else [(i, j) for i in range(3) for j in range(3)]
        rows = np.zeros((len(signal), 3, count))
        for k, (i, j) in enumerate(elements):
            rows[:, i, k] = signal[:, j]
        variances.append(np.einsum("nik,kl,nil->ni", rows, C, rows))
    return np.sqrt(variances[0] + variances[1]) / G, np.sqrt(variances[2] + variances[3])
