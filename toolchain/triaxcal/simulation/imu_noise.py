"""Noise and counting of a simulated triad: white noise, random walk of the bias, quantisation.

Each source has a random generator of its own, drawn sample by sample, so that a recording does not
depend on how it is cut into pieces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from triaxcal.dynamic.recording import INCREMENT
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_truth import ARCSEC, DEG_PER_H, MICRO_G, ImuTruth

GYRO, ACCEL, SECOND, TEMPERATURE, TABLE, GYRO_TEMPERATURE = range(1000, 1006)
"""Beside those of the constants, which are drawn from the same seed."""
_WALK = 10


def white(seed: int, source: int) -> np.random.Generator:
    """Random generator of one source of noise."""
    return np.random.Generator(np.random.PCG64([seed, source]))


@dataclass
class Channel:
    """What is between a triad and its readings; it goes through a recording once, from the start.

    Attributes
    ----------
    noise, walk : numpy Generator
    white_sd, walk_sd : float
        Standard deviation of one reading, and of the bias' change from one reading to the next as
        it is in a reading.
    lsb : float
        One count of a reading, or of the readings' sum where `accumulates`; 0 does not count.
    accumulates : bool
        Increments: the remainder of a count is not lost but shows in the next reading.
    """

    noise: np.random.Generator
    walk: np.random.Generator
    white_sd: float
    walk_sd: float
    lsb: float
    accumulates: bool
    _bias: FloatArray = field(default_factory=lambda: np.zeros(3))
    _remainder: FloatArray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def gyros(cls, truth: ImuTruth, step_s: float, seed: int) -> Channel:
        """Channel of the gyros; readings in rad/s or rad."""
        noise = truth.noise
        # deg/sqrt(h) and deg/h/sqrt(h): a square root of an hour is 60 square roots of a second.
        arw = math.radians(noise.gyro_arw_deg_per_sqrt_h) / 60.0
        walk = DEG_PER_H * noise.gyro_walk_deg_per_h_per_sqrt_h / 60.0
        counts = truth.rate_convention == INCREMENT
        lsb = noise.gyro_lsb * (ARCSEC if counts else DEG_PER_H)
        return cls._of(seed, GYRO, _steps(arw, walk, step_s, counts), lsb, counts)

    @classmethod
    def accelerometers(cls, truth: ImuTruth, step_s: float, seed: int, source: int) -> Channel:
        """Channel of an accelerometer triad; readings in m/s^2 or m/s."""
        noise = truth.noise
        vrw = MICRO_G * noise.accel_vrw_ug_per_sqrt_hz
        walk = MICRO_G * noise.accel_walk_ug_per_sqrt_h / 60.0
        counts = truth.force_convention == INCREMENT
        lsb = noise.accel_lsb * (1e-3 if counts else MICRO_G)
        return cls._of(seed, source, _steps(vrw, walk, step_s, counts), lsb, counts)

    @classmethod
    def _of(
        cls, seed: int, source: int, steps: tuple[float, float], lsb: float, counts: bool
    ) -> Channel:
        return cls(white(seed, source), white(seed, source + _WALK), *steps, lsb, counts)

    def read(self, ideal: FloatArray) -> FloatArray:
        """Readings (n, 3) of the next n ideal ones."""
        result = ideal
        if self.white_sd:
            result = result + self.white_sd * self.noise.standard_normal(ideal.shape)
        if self.walk_sd:
            bias = self._bias + np.cumsum(
                self.walk_sd * self.walk.standard_normal(ideal.shape), axis=0
            )
            self._bias = bias[-1]
            result = result + bias
        if self.lsb:
            result = self._counted(result)
        return result

    def _counted(self, readings: FloatArray) -> FloatArray:
        if not self.accumulates:
            rounded: FloatArray = self.lsb * np.rint(readings / self.lsb)
            return rounded
        total = self._remainder + np.cumsum(readings, axis=0)
        counts = np.rint(total / self.lsb)
        self._remainder = total[-1] - self.lsb * counts[-1]
        emitted: FloatArray = self.lsb * np.diff(counts, axis=0, prepend=np.zeros((1, 3)))
        return emitted


def _steps(density: float, walk: float, step_s: float, counts: bool) -> tuple[float, float]:
    """White and walking deviations of one reading: a mean over a step, or the mean times it."""
    unit = step_s if counts else 1.0
    return unit * density / math.sqrt(step_s), unit * walk * math.sqrt(step_s)
