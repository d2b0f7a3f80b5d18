"""Mean of a pose, and how well it is known: its scatter, its drift, the steps of its readings."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.readings.samples import READING, Samples

BATCHES = 8


@dataclass(frozen=True)
class Mean:
    """Mean readings of a stretch, in the unit of the layout.

    Attributes
    ----------
    reading : array, shape (3,)
    covariance : array, shape (3, 3)
        Of `reading`, from the means of `BATCHES` equal parts: what sways or drifts from part to
        part is noise in it. No less than that of independent samples.
    scatter : array, shape (3,)
        Standard deviation of the samples.
    drift : array, shape (3,)
        Mean of the second half less that of the first.
    """

    reading: FloatArray
    covariance: FloatArray
    scatter: FloatArray
    drift: FloatArray


def mean_of(samples: Samples, run: tuple[int, int], one_g: float) -> Mean:
    """Mean of the samples of a run; `one_g` is about the reading of 1 g."""
    start, stop = run
    count = stop - start
    batches = min(BATCHES, count)
    ends = [start + k * count // batches for k in range(batches + 1)]
    parts = np.array([samples.mean(READING, *part) for part in pairwise(ends)])
    scatter = samples.deviation(READING, start, stop)
    half = batches // 2
    drift = parts[batches - half :].mean(axis=0) - parts[:half].mean(axis=0) if half else None
    return Mean(
        reading=samples.mean(READING, start, stop),
        covariance=_covariance(parts, scatter, count, one_g),
        scatter=scatter,
        drift=np.zeros(3) if drift is None else drift,
    )


def _covariance(parts: FloatArray, scatter: FloatArray, count: int, one_g: float) -> FloatArray:
    batches = len(parts)
    if batches < 2:
        return np.full((3, 3), np.inf)
    found = np.atleast_2d(np.cov(parts, rowvar=False)) / batches
    least = scatter**2 / count
    found[np.diag_indices(3)] = np.maximum(np.diag(found), least)
    # A direction that varies by d makes the mean of forces of 1 g shorter by d^2 / 2.
    sway = parts.var(axis=0).sum() / one_g**2
    result: FloatArray = found + np.eye(3) * (0.5 * sway * one_g) ** 2
    return result
