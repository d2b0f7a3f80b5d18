"""A unit turned by hand from pose to pose, with flicker noise: written apart from the estimator.

Poses of 2 to 4.5 s in random attitudes; between them one turn about a fixed axis, by a smooth
angle. Rates and forces are exact at each sample, with the Earth's rate and without translation.
Flicker noise is shaped in the frequency domain, over eight times the recording's length, or summed
of many Gauss-Markov processes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from triaxcal.dynamic.recording import ImuRecording, ImuSamples

LATITUDE_DEG, GRAVITY = 50.0, 9.8107
EARTH = 7.292115e-5
DEG_PER_H, UG = math.pi / 180 / 3600, 9.80665e-6


@dataclass(frozen=True)
class HandNoise:
    """White noise N and bias instability B of IEEE 952, counts; as a data sheet has them."""

    gyro_n: float = 0.118794
    accel_n: float = 49.4975
    gyro_b: float = 1.6
    accel_b: float = 12.0
    gyro_lsb_deg_per_s: float = 1 / 131
    accel_lsb: float = 122.07


def attitude_and_rate(
    rng: np.random.Generator, rate_hz: float, minutes: float, still_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """L^T (instrument to east, north, up), shape (n, 3, 3), and rates against inertial space."""
    attitude, rates = [], []
    now = Rotation.from_euler("xyz", rng.uniform(-0.05, 0.05, 3))
    count, first = 0, True
    while count < minutes * 60 * rate_hz:
        rest = round((still_s if first else rng.uniform(2.0, 4.5)) * rate_hz)
        axis = rng.standard_normal(3)
        angle, length = rng.uniform(1.0, 3.0), rng.uniform(1.2, 2.2)
        turn = axis / np.linalg.norm(axis) * angle
        x = np.arange(1, round(length * rate_hz) + 1) / round(length * rate_hz)
        way = x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)
        speed = 140 * x**3 * (1 - x) ** 3 / (round(length * rate_hz) / rate_hz)
        way, speed = np.r_[np.zeros(rest), way], np.r_[np.zeros(rest), speed]
        attitude.append((now * Rotation.from_rotvec(way[:, None] * turn)).as_matrix())
        rates.append(speed[:, None] * turn)
        now = now * Rotation.from_rotvec(turn)
        count += len(way)
        first = False
    C = np.concatenate(attitude)
    latitude = math.radians(LATITUDE_DEG)
    earth = EARTH * np.array([0.0, math.cos(latitude), math.sin(latitude)])
    return C, np.concatenate(rates) + np.einsum("nji,j->ni", C, earth)


def shaped_flicker(rng: np.random.Generator, n: int, step_s: float, B: float) -> np.ndarray:
    """Noise (n, 3) of the two-sided density B^2/(2 pi f) above 1/(8 n step)."""
    long = 8 * n
    f = np.fft.rfftfreq(long, step_s)
    amplitude = np.zeros(len(f))
    amplitude[1:] = B / np.sqrt(2 * np.pi * f[1:])
    white = rng.standard_normal((3, long))
    made = np.fft.irfft(np.fft.rfft(white) * amplitude / math.sqrt(step_s), long)
    start = int(rng.integers(0, long - n))
    return made[:, start : start + n].T


def summed_flicker(rng: np.random.Generator, n: int, step_s: float, B: float) -> np.ndarray:
    """The same of Gauss-Markov processes, two an octave, from two steps to ten lengths."""
    taus = np.exp(np.arange(math.log(2 * step_s), math.log(10 * n * step_s), math.log(2) / 2))
    made = np.zeros((n, 3))
    for tau in taus:
        sd, keep = B * math.sqrt(math.log(2) / 2 / math.pi), math.exp(-step_s / tau)
        drive = sd * rng.standard_normal((n, 3)) * math.sqrt(1 - keep**2)
        drive[0] = sd * rng.standard_normal(3)
        made += lfilter([1.0], [1.0, -keep], drive, axis=0)
    return made


def hand_recording(
    seed: int,
    noise: HandNoise,
    *,
    flicker=shaped_flicker,
    rate_hz: float = 100.0,
    minutes: float = 3.0,
    still_s: float = 10.0,
    bend=None,
) -> tuple[dict[str, float], ImuRecording]:
    """True constants by name, SI, and the recording."""
    rng = np.random.default_rng([seed, 16])
    C, rate = attitude_and_rate(rng, rate_hz, minutes, still_s)
    n, step_s = len(C), 1 / rate_hz
    force = GRAVITY * C[:, 2, :]
    theta = 4e-3 * rng.standard_normal((3, 3))
    gamma = np.tril(4e-3 * rng.standard_normal((3, 3)))
    nu, df = 3e-3 * rng.standard_normal(3), 0.02 * rng.standard_normal(3)
    gyro = rate + rate @ theta.T + nu
    gyro = gyro if bend is None else gyro + bend(rate)
    accel = force + force @ gamma.T + df
    root = 1 / math.sqrt(step_s)
    gyro = gyro + noise.gyro_n * math.pi / 180 / 60 * root * rng.standard_normal((n, 3))
    accel = accel + noise.accel_n * UG * root * rng.standard_normal((n, 3))
    gyro = gyro + flicker(rng, n, step_s, noise.gyro_b * DEG_PER_H)
    accel = accel + flicker(rng, n, step_s, noise.accel_b * UG)
    gyro_lsb, accel_lsb = math.radians(noise.gyro_lsb_deg_per_s), noise.accel_lsb * UG
    if gyro_lsb:
        gyro = gyro_lsb * np.rint(gyro / gyro_lsb)
    if accel_lsb:
        accel = accel_lsb * np.rint(accel / accel_lsb)
    samples = ImuSamples(np.arange(1, n + 1) / rate_hz, gyro, accel)
    true = {f"nu0_{i + 1}": nu[i] for i in range(3)} | {f"df0_{i + 1}": df[i] for i in range(3)}
    for i in range(3):
        for j in range(3):
            true[f"Theta{i + 1}{j + 1}"] = theta[i, j]
            true[f"Gamma{i + 1}{j + 1}"] = gamma[i, j]
    return true, ImuRecording(
        f"hand, seed {seed}", lambda: (samples,), rate_hz, LATITUDE_DEG, GRAVITY
    )
