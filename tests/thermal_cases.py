"""IMUs whose constants follow cubics over temperature: programmes, truth, errors of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynamic_cases import held, sheet
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.overtemperature import Solved, Temperatures, solve_over_temperature
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.several import joined_recordings
from triaxcal.dynamic.temperatures import recorded_temperatures
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting, Move
from triaxcal.simulation.imu_temperature import TemperatureDrift, TemperatureRamp
from triaxcal.simulation.imu_truth import ImuTruth
from triaxcal.unit.thermal import ThermalChoice

POINTS = (-40.0, -10.0, 20.0, 50.0, 85.0)
TURNS = (Move(360.0, 60.0, 4.0), Move(-450.0, 45.0, 4.0), Move(270.0, 30.0, 4.0))
RATE_HZ = 25.0


def truth_of(seed: int, grade: str = "mems") -> ImuTruth:
    return draw_truth(GRADES[grade], seed, ("cubic-temperature",))


def at_point(truth: ImuTruth, degc: float, seed: int) -> ImuRecording:
    """Half a minute an axis at one temperature, which is still settling by 0.3 degC."""
    drift = TemperatureDrift(degc - 0.3, degc, 60.0)
    motion = ImuMotion(tuple(Mounting(TURNS, 12.0) for _ in range(3)), temperature=drift)
    return held(simulate_imu(truth, motion, RATE_HZ, seed))


def own_degc(degc: float) -> float:
    """Temperature of gyros that warm themselves, beside accelerometers at `degc`."""
    return 1.04 * degc + 7.0


def apart_at_point(truth: ImuTruth, degc: float, seed: int) -> ImuRecording:
    """As `at_point`; the gyros have their own temperature, and are sooner at it."""
    drift = TemperatureDrift(degc - 2.0, degc, 60.0)
    own = TemperatureDrift(own_degc(degc) - 4.0, own_degc(degc), 20.0)
    mountings = tuple(Mounting(TURNS, 12.0) for _ in range(3))
    motion = ImuMotion(mountings, temperature=drift, gyro_temperature=own)
    return held(simulate_imu(truth, motion, RATE_HZ, seed))


def points_of(truth: ImuTruth, seed: int) -> list[ImuRecording]:
    return [at_point(truth, degc, 100 * seed + k) for k, degc in enumerate(POINTS)]


def five_points(truth: ImuTruth, seed: int) -> ImuRecording:
    return joined_recordings(points_of(truth, seed))


def ramp(
    truth: ImuTruth, axis: int, ends_degc: tuple[float, float], seed: int, rounds: int = 6
) -> ImuRecording:
    """One axis on the table from one temperature to another, without waiting; or without turns."""
    moves = TURNS * rounds
    mountings = tuple(Mounting(moves if k == axis else TURNS[:1], 12.0) for k in range(axis + 1))
    if rounds == 0:
        mountings = (Mounting((), 400.0),)
    motion = ImuMotion(mountings)
    motion = ImuMotion(mountings, temperature=TemperatureRamp(*ends_degc, motion.duration_s))
    return held(simulate_imu(truth, motion, RATE_HZ, seed))


def three_ramps(truth: ImuTruth, seed: int) -> ImuRecording:
    """Up, down and up again, another axis each time."""
    ends = (-40.0, 85.0), (85.0, -40.0), (-40.0, 85.0)
    return joined_recordings([ramp(truth, k, e, 100 * seed + k) for k, e in enumerate(ends)])


def ramps_of(truth: ImuTruth, seed: int) -> list[ImuRecording]:
    """As `three_ramps`, a degree beyond both ends; nothing is recorded between 25 and 45 degC."""
    spans = (-41.0, 25.0), (45.0, 86.0)
    up = [(axis, span) for axis in (0, 2) for span in spans]
    down = [(1, (high, low)) for low, high in reversed(spans)]
    parts = up[:2] + down + up[2:]
    return [
        ramp(truth, axis, ends, 100 * seed + k, rounds=3) for k, (axis, ends) in enumerate(parts)
    ]


PROGRAMMES = {"points": points_of, "ramps": ramps_of}
HELD_OUT = {"points": (-25.0, 5.0, 35.0, 70.0), "ramps": (30.0, 35.0, 40.0)}
"""Temperatures of which no recording shows anything: the nearest is 5 to 17.5 degC away."""


def solved(truth: ImuTruth, recording: ImuRecording, stated: ThermalChoice | None = None) -> Solved:
    recorded = recorded_temperatures(recording)
    assert recorded is not None
    at = Temperatures(recorded, stated or ThermalChoice("auto"), 20.0, "unit.toml")
    noise: DataSheet = sheet(truth)
    return solve_over_temperature(recording, noise, (), at, lambda _step, _part: None)


def true_at(truth: ImuTruth, temps_degc: FloatArray) -> FloatArray:
    """Constants in the order of the filter, SI, shape (k, 21): by the truth's own cubics."""
    x = (np.asarray(temps_degc) - truth.reference_degc) / 60.0
    powers = x[:, None] ** np.arange(1, 4)
    curved = truth.curved
    assert curved is not None
    deg_per_h, ppm = np.pi / 180 / 3600, 1e-6
    n = len(x)
    bias = 1e-3 * (truth.accel_bias_mm_per_s2 + powers @ np.array(curved.accel_bias_mm_per_s2))
    gamma = truth.accel_matrix().ravel() + ppm * powers @ np.array(curved.accel_matrix_ppm)
    drift = deg_per_h * (truth.gyro_bias_deg_per_h + powers @ np.array(curved.gyro_bias_deg_per_h))
    theta = truth.gyro_matrix().ravel() + ppm * powers @ np.array(curved.gyro_matrix_ppm)
    lower = [0, 3, 4, 6, 7, 8]
    found = np.concatenate([bias, gamma.reshape(n, 9)[:, lower], drift, theta], axis=1)
    return np.asarray(found)


@dataclass(frozen=True)
class Judged:
    """Errors over the grid in standard deviations, shape (temperatures, 21)."""

    z: FloatArray
    solved: Solved


def judged(truth: ImuTruth, recording: ImuRecording) -> Judged:
    found = solved(truth, recording)
    known = found.over.known
    return Judged((known.value - true_at(truth, known.temps_degc)) / known.sd, found)
