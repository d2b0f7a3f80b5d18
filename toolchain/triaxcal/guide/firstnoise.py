"""Noise of the first rest, to guide by where unit.toml states none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.model.types import FloatArray


def is_stated(noise: DataSheet) -> bool:
    """Whether the white noise of both triads is stated."""
    return None not in {noise.gyro_arw_deg_per_sqrt_h, noise.accel_vrw_ug_per_sqrt_hz}


def with_rest(noise: DataSheet, samples: ImuSamples, rate_hz: float) -> DataSheet:
    """White noise where it is not stated, from samples at rest, rms over the axes.

    From the changes between samples: a change has twice the variance, and nothing slow in it.
    """

    def density(values: FloatArray) -> float:
        return math.sqrt(float(np.diff(values, axis=0).var(axis=0).mean()) / 2 / rate_hz)

    arw, vrw = noise.gyro_arw_deg_per_sqrt_h, noise.accel_vrw_ug_per_sqrt_hz
    if arw is None:
        arw = max(math.degrees(density(samples.rate)) * 60, 1e-6)
    if vrw is None:
        vrw = max(density(samples.force) / MICRO_G, 1e-3)
    return replace(noise, gyro_arw_deg_per_sqrt_h=arw, accel_vrw_ug_per_sqrt_hz=vrw)
