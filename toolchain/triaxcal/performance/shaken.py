"""The compiled C on a generated vibration: the shift of its mean, with its statistical interval.

Raw model of the sensor, in the unit's axes:

    U = K (e(a)) + U0,    e_i = a_i + K2_i a_i^2 + Koq_i a_i |a_i| + K3_i a_i^3 + K_jk a_j a_k

rounded to codes and clipped as the converter does. The random part is made by its Fourier
coefficients: independent, Gaussian, of the variance that the density has in each bin, so that its
mean over a block is 0 exactly. Blocks are independent; their means give the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.coverage import coverage_factor
from triaxcal.unit.adc import Adc
from triaxcal.unit.vibration import Vibration

Int32Array = np.ndarray[tuple[int, ...], np.dtype[np.int32]]
UInt32Array = np.ndarray[tuple[int, ...], np.dtype[np.uint32]]
Run = Callable[[Int32Array], tuple[Int32Array, UInt32Array]]
"""Answers (n, 3) and status (n,) of the C at T0 to raw codes (n, 3)."""
BLOCKS, SAMPLES = 32, 8192
_OVER_HIGHEST = 4.0
"""Sample rate, of the highest frequency."""


@dataclass(frozen=True)
class Sensor:
    """What the codes are made of.

    Attributes
    ----------
    gain, offset : arrays, shape (3, 3) and (3,)
        K and U0 in V.
    own_square, odd_square, cube : arrays, shape (3,)
        g/g^2 and g/g^3.
    cross : array, shape (3, 6)
        Products of two axes; own squares are 0 in it.
    adc : Adc
    """

    gain: FloatArray
    offset: FloatArray
    own_square: FloatArray
    odd_square: FloatArray
    cube: FloatArray
    cross: FloatArray
    adc: Adc

    def voltage(self, force_g: FloatArray) -> FloatArray:
        """Outputs (n, 3) in V of forces (n, 3)."""
        bent = force_g + self.own_square * force_g**2 + self.odd_square * force_g * np.abs(force_g)
        bent = bent + self.cube * force_g**3 + products(force_g) @ self.cross.T
        result: FloatArray = bent @ self.gain.T + self.offset
        return result

    def codes(self, force_g: FloatArray) -> tuple[Int32Array, FloatArray]:
        """Codes (n, 3), and the share that the converter has clipped, (3,)."""
        exact = np.rint(self.voltage(force_g) / self.adc.volts_per_code)
        clipped = (exact < self.adc.code_min) | (exact > self.adc.code_max)
        codes = np.clip(exact, self.adc.code_min, self.adc.code_max)
        return codes.astype(np.int32), clipped.mean(axis=0)


@dataclass(frozen=True)
class Shaken:
    """What the C gave.

    Attributes
    ----------
    shift_g, expanded_g : arrays, shape (3,)
        Mean under vibration less that of the static force, and its statistical 95 % half-width.
    clipped : array, shape (3,)
        Share of the codes at the converter's ends.
    flagged : float
        Share of the samples whose status is not good.
    samples : int
    """

    shift_g: FloatArray
    expanded_g: FloatArray
    clipped: FloatArray
    flagged: float
    samples: int


def shaken(
    vibration: Vibration, static_g: FloatArray, sensor: Sensor, run: Run, lsb_g: float, *, seed: int
) -> Shaken:
    """Run the C on a vibration about a static force, shape (3,).

    The reference is the C's own answer to the static force, between the codes on both sides of the
    exact voltage: an affine function of each code but for its rounding.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    direction = np.array(vibration.direction)
    rest = _static(static_g, sensor, run, lsb_g)
    means, clipped, flagged = [], [], []
    for _ in range(BLOCKS):
        force = static_g + block(vibration, random)[:, None] * direction
        codes, beyond = sensor.codes(force)
        accel, status = run(codes)
        means.append(accel.astype(np.float64).mean(axis=0) * lsb_g - rest)
        clipped.append(beyond)
        flagged.append(float(np.mean(status != 0)))
    each = np.array(means)
    expanded = coverage_factor(BLOCKS - 1.0) * each.std(axis=0, ddof=1) / math.sqrt(BLOCKS)
    return Shaken(
        each.mean(axis=0),
        np.asarray(expanded),
        np.mean(clipped, axis=0),
        float(np.mean(flagged)),
        BLOCKS * SAMPLES,
    )


def block(vibration: Vibration, random: np.random.Generator) -> FloatArray:
    """One block of the vibration along its direction, shape (`SAMPLES`,), g."""
    rate = _OVER_HIGHEST * vibration.highest_hz
    result = np.zeros(SAMPLES)
    if vibration.points:
        f = np.fft.rfftfreq(SAMPLES, 1.0 / rate)
        points = np.log(np.array(vibration.points))
        density = np.zeros(len(f))
        inside = (f > 0.0) & (f >= vibration.points[0][0]) & (f <= vibration.points[-1][0])
        density[inside] = np.exp(np.interp(np.log(f[inside]), points[:, 0], points[:, 1]))
        if not inside.any():  # a band between two frequencies of the block: the nearest has it all
            density[1 + int(np.argmin(np.abs(f[1:] - np.exp(points[:, 0].mean()))))] = 1.0
        variance = density / density.sum() * vibration.random_g2
        parts = random.standard_normal((2, len(f))) * np.sqrt(variance) * SAMPLES / 2.0
        result = np.fft.irfft(parts[0] - 1j * parts[1], SAMPLES)
    if vibration.sine_g:
        # A whole number of turns, so that its mean is 0, and prime to the samples of the block.
        turns = max(1, round(vibration.sine_hz / rate * SAMPLES)) | 1
        turn = 2.0 * np.pi * (turns * np.arange(SAMPLES) / SAMPLES + random.uniform())
        result = result + vibration.sine_g * np.sin(turn)
    return np.asarray(result)


def _static(static_g: FloatArray, sensor: Sensor, run: Run, lsb_g: float) -> FloatArray:
    exact = sensor.voltage(static_g[None])[0] / sensor.adc.volts_per_code
    below = np.floor(exact)
    corners = np.array([[(c >> k) & 1 for k in range(3)] for c in range(8)])
    part = exact - below
    weight = np.prod(np.where(corners == 1, part, 1.0 - part), axis=1)
    codes = np.clip(below + corners, sensor.adc.code_min, sensor.adc.code_max).astype(np.int32)
    accel, _ = run(codes)
    result: FloatArray = weight @ accel.astype(np.float64) * lsb_g
    return result
