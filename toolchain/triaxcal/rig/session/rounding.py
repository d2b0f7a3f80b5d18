"""Readings that are rounded to steps larger than their noise."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.rig.bus.frames import BoolArray

ONE_CODE = np.ones(3)
"""Step to which readings are rounded, in codes, where nothing else is said."""
LEAST_VARIANCE = 1.0 / 12.0 / 1e4
FLICKER = 0.25
"""Largest variance of readings that flicker between two codes, in steps squared."""
_HIDES = 0.5
"""Below this variance in steps squared the noise depends on where between two codes a force is."""


def at_least(variance: FloatArray | tuple[float, float, float], step: FloatArray) -> FloatArray:
    """A variance, no smaller than what it may be elsewhere: noise can hide in one code.

    Readings whose noise is small against a step rest on one code in one position, and flicker
    between two in another.
    """
    found = np.asarray(variance, np.float64)
    elsewhere = np.where(hides(found, step), found + FLICKER * step**2, found)
    least: FloatArray = np.maximum(elsewhere, LEAST_VARIANCE)
    return least


def hides(variance: FloatArray, step: FloatArray) -> BoolArray:
    """Which axes have noise that is small against a step."""
    return np.asarray(variance < _HIDES * step**2, np.bool_)


def rounding(variance: FloatArray, step: FloatArray) -> FloatArray:
    """Variance of the mean of rounded readings about the true one, shape (3,), code^2.

    Sum over k of q^2 / (2 pi^2 k^2) exp(-4 pi^2 k^2 sigma^2 / q^2) with the step q and noise sigma:
    q^2 / 12 without noise, nothing from half a step on. Widrow and Kollar, Quantization Noise
    (2008), from the characteristic function of Gaussian noise.
    """
    q = np.where(step > 0.0, step, 1.0)
    sigma_squared = np.maximum(variance / q**2 - 1.0 / 12.0, 0.0)
    k = np.arange(1, 60)[:, None]
    parts = np.exp(-4.0 * np.pi**2 * k**2 * sigma_squared) / (2.0 * np.pi**2 * k**2)
    return np.asarray(np.where(step > 0.0, q**2 * parts.sum(axis=0), 0.0), np.float64)
