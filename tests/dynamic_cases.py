"""Recordings for the tests of dynamic/, by the simulator of exact physics, made once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting, Move, three_axes
from triaxcal.simulation.imu_truth import ImuNoise, ImuTruth

SHORT_MOVES = (Move(360.0, 60.0, 3.0), Move(-450.0, 45.0, 3.0), Move(270.0, 30.0, 3.0))


def perfect(truth: ImuTruth) -> ImuTruth:
    """The same without anything random."""
    return replace(truth, noise=ImuNoise())


def short_motion(axes: int = 3) -> ImuMotion:
    """Three quick turns about each axis; half a minute an axis."""
    return ImuMotion(tuple(Mounting(SHORT_MOVES, 12.0) for _ in range(axes)))


def held(recording: ImuRecording) -> ImuRecording:
    """The same in memory."""
    samples = recording.all()
    return replace(recording, pieces=lambda: (samples,))


@cache
def mems_short() -> tuple[ImuTruth, ImuRecording]:
    truth = draw_truth(GRADES["mems"], 1)
    return truth, held(simulate_imu(truth, short_motion(), 50.0, 1))


@cache
def aviation() -> tuple[ImuTruth, ImuRecording]:
    truth = draw_truth(GRADES["aviation"], 2)
    return truth, held(simulate_imu(truth, three_axes(3.0, still_s=60.0), 50.0, 2))


def sheet(truth: ImuTruth) -> DataSheet:
    noise = truth.noise
    return DataSheet(
        noise.gyro_arw_deg_per_sqrt_h,
        noise.accel_vrw_ug_per_sqrt_hz,
        accel_lsb=noise.accel_lsb,
        table_sd_arcsec=noise.table_sd_arcsec,
        gyro_bias_instability_deg_per_h=0.0,
        accel_bias_instability_ug=0.0,
    )


def changed(recording: ImuRecording, **columns: np.ndarray) -> ImuRecording:
    """Recording with other columns."""
    samples = replace(recording.all(), **columns)
    return replace(recording, pieces=lambda: (samples,))


def recording_of(samples: ImuSamples, name: str, **about: float | str) -> ImuRecording:
    """Recording held in memory; `about` are the remaining attributes of `ImuRecording`."""
    return ImuRecording(name, lambda: (samples,), **about)


def part(recording: ImuRecording, keep: np.ndarray) -> ImuRecording:
    """Only the samples that `keep` marks."""
    s = recording.all()
    chosen = ImuSamples(s.time_s[keep], s.rate[keep], s.force[keep])
    about = {
        "rate_hz": recording.rate_hz,
        "latitude_deg": recording.latitude_deg,
        "gravity_m_per_s2": recording.gravity_m_per_s2,
        "rate_convention": recording.rate_convention,
        "force_convention": recording.force_convention,
    }
    return recording_of(chosen, recording.name, **about)


UNIT_TOML = """\
format = 1
serial = "IMU-TEST-001"
[site]
latitude_deg = 50
local_gravity_m_per_s2 = 9.8107
[dynamic]
recording = "recording.csv"
time_column = "time_s"
rate_columns = ["gx", "gy", "gz"]
rate_unit = "rad/s"
rate_samples = "instant"
force_columns = ["ax", "ay", "az"]
force_unit = "m/s^2"
force_samples = "instant"
[noise]
gyro_arw_deg_per_sqrt_h = 0.3
accel_vrw_ug_per_sqrt_hz = 100
accel_lsb = 10
gyro_bias_instability_deg_per_h = 0
accel_bias_instability_ug = 0
"""
COLUMNS = ("time_s", "gx", "gy", "gz", "ax", "ay", "az", "temp_degc")


def table_of(recording: ImuRecording) -> np.ndarray:
    """Columns of the file, shape (n, 8), or (n, 9) where the gyros have a thermometer."""
    s = recording.all()
    assert s.temp_degc is not None
    own = () if s.gyro_temp_degc is None else (s.gyro_temp_degc,)
    return np.column_stack([s.time_s, s.rate, s.force, s.temp_degc, *own])


def write_unit(folder: Path, table: np.ndarray, toml: str = UNIT_TOML) -> Path:
    """Folder of a unit with its recording as CSV."""
    folder.mkdir(parents=True)
    (folder / "unit.toml").write_text(toml, encoding="utf-8")
    header = ",".join((*COLUMNS, "gyro_temp_degc")[: table.shape[1]])
    np.savetxt(
        folder / "recording.csv", table, fmt="%.17g", delimiter=",", header=header, comments=""
    )
    return folder
