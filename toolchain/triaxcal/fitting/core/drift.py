"""One orientation over temperature: what the outputs do, heating against cooling.

The record is cut at the turning points of its temperature into half-cycles. Each candidate, a
function of temperature with or without a term in dT/dt, is fitted to all half-cycles but one and
judged on that one, at the temperatures that the others cover. Samples are weighted so that each
degree counts the same: a slow ramp has more samples, not more to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.halfcycles import (
    TURN_DEGC,
    HalfCycle,
    half_cycles,
    hysteresis,
    smoothed,
)
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.samples import READING, TEMP, Samples

ORDERS = (0, 1, 2, 3, 4, 5)
KNOTS = 10


@dataclass(frozen=True)
class DriftRow:
    """One candidate, its errors in reading units.

    Attributes
    ----------
    fitted : array, shape (3,)
        Rms residual per output, each degree weighted alike.
    held_out : array, shape (half-cycles, 3), or None
        Rms error on each half-cycle held out; None with fewer than two.
    rate : array, shape (3,), or None
        Coefficient of dT/dt, reading units per K/s.
    """

    label: str
    parameters: int
    fitted: FloatArray
    held_out: FloatArray | None
    rate: FloatArray | None

    @property
    def score(self) -> float:
        """Rms held-out error over half-cycles and outputs."""
        return math.inf if self.held_out is None else float(np.sqrt(np.mean(self.held_out**2)))


@dataclass(frozen=True)
class Drift:
    """The study of one record.

    Attributes
    ----------
    temp_degc, rate_k_per_s : arrays, shape (n,)
        Smoothed.
    halves : tuple of HalfCycle
    rows : tuple of DriftRow
    chosen : DriftRow
        The best held out, or the simplest within a tenth of it.
    hysteresis : array, shape (3,)
        Largest difference of heating and cooling at one temperature, reading units.
    hysteresis_degc : array, shape (3,)
        Where.
    """

    temp_degc: FloatArray
    rate_k_per_s: FloatArray
    halves: tuple[HalfCycle, ...]
    rows: tuple[DriftRow, ...]
    chosen: DriftRow
    hysteresis: FloatArray
    hysteresis_degc: FloatArray


def study(samples: Samples) -> Drift:
    """Half-cycles, hysteresis and candidates of a record in one orientation.

    Raises
    ------
    RefusedError
        When there is no temperature, it does not move, or there are too few samples.
    """
    if TEMP not in samples:
        raise RefusedError(
            samples.source,
            "no temperature column",
            expected="[recording] temperature",
            remedy="name the column of the temperature",
        )
    temp, rate = smoothed(samples)
    halves = half_cycles(temp)
    if not halves:
        raise RefusedError(
            samples.source,
            f"the temperature stays within {np.ptp(temp):.2g} degC",
            expected=f"a change of {TURN_DEGC:g} degC at least",
        )
    reading = samples.part(READING)
    rows = _rows(reading, temp, rate, halves)
    best = min(row.score for row in rows)
    # A tenth: half-cycles are few, and an rms of three is known to no better than a third.
    chosen = min(
        (row for row in rows if row.score <= 1.1 * best or math.isinf(best)),
        key=lambda row: (row.parameters, row.score),
    )
    size, where = hysteresis(reading, temp, halves)
    return Drift(temp, rate, halves, rows, chosen, size, where)


def _rows(
    reading: FloatArray, temp: FloatArray, rate: FloatArray, halves: tuple[HalfCycle, ...]
) -> tuple[DriftRow, ...]:
    x = (temp - temp.mean()) / (np.ptp(temp) / 2.0)
    scale = float(np.abs(rate).max()) or 1.0
    bases = [(f"polynomial of order {k}", np.vander(x, k + 1, increasing=True)) for k in ORDERS]
    bases.append((f"piecewise-linear, {KNOTS} knots", _hats(temp)))
    rows = []
    for label, basis in bases:
        rows.append(_row(label, basis, reading, temp, halves, rate_scale=None))
        with_rate = np.column_stack([basis, rate / scale])
        rows.append(_row(f"{label} and dT/dt", with_rate, reading, temp, halves, rate_scale=scale))
    return tuple(rows)


def _hats(temp: FloatArray) -> FloatArray:
    knots = np.linspace(temp.min(), temp.max(), KNOTS)
    eye = np.eye(KNOTS)
    return np.stack([np.interp(temp, knots, eye[k]) for k in range(KNOTS)], axis=1)


def _row(
    label: str,
    basis: FloatArray,
    reading: FloatArray,
    temp: FloatArray,
    halves: tuple[HalfCycle, ...],
    *,
    rate_scale: float | None,
) -> DriftRow:
    every = np.ones(len(temp), dtype=np.bool_)
    solution = _solve(basis, reading, temp, every)
    held_out = []
    for half in halves if len(halves) > 1 else ():
        kept = every.copy()
        kept[half.start : half.stop] = False
        part = _solve(basis, reading, temp, kept)
        low, high = temp[kept].min(), temp[kept].max()
        judged = ~kept & (low <= temp) & (temp <= high)
        if judged.any():
            held_out.append(_rms(basis, reading, temp, judged, part))
    return DriftRow(
        label=label,
        parameters=basis.shape[1],
        fitted=_rms(basis, reading, temp, every, solution),
        held_out=np.array(held_out) if held_out else None,
        rate=None if rate_scale is None else solution[-1] / rate_scale,
    )


def degree_weights(temp: FloatArray) -> FloatArray:
    """Weights, shape (n,), mean 1, with which each degree counts the same."""
    _, index, count = np.unique(np.floor(temp), return_inverse=True, return_counts=True)
    weight = 1.0 / count[index]
    result: FloatArray = weight / weight.mean()
    return result


def _solve(basis: FloatArray, reading: FloatArray, temp: FloatArray, kept: BoolArray) -> FloatArray:
    root = np.sqrt(degree_weights(temp[kept]))[:, None]
    found = np.linalg.lstsq(root * basis[kept], root * reading[kept], rcond=1e-10)[0]
    return found.astype(np.float64)


def _rms(
    basis: FloatArray,
    reading: FloatArray,
    temp: FloatArray,
    judged: BoolArray,
    solution: FloatArray,
) -> FloatArray:
    error = reading[judged] - basis[judged] @ solution
    weight = degree_weights(temp[judged])[:, None]
    result: FloatArray = np.sqrt(np.mean(weight * error**2, axis=0))
    return result
