"""Priors of a type of sensor, learned from a series of its recordings.

The scales of the groups of constants are those under which the poses of all units together are most
probable: the marginal likelihood, by Laplace's approximation about each unit's solution, in which
the constants are integrated out and so is each unit's noise. A hyperprior holds each scale near the
default, log-normal with `SPREAD`: a series of few or noisy units moves it little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.fitting.recorded.calibrate import fit_of_all_terms
from triaxcal.fitting.recorded.contradicted import log_evidence
from triaxcal.fitting.recorded.prior import Known
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.types import FloatArray
from triaxcal.readings.samples import read_samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import Priors
from triaxcal.unit.recording import RecordingLayout

SPREAD = 1.0
"""Standard deviation of ln(scale / default): a factor of 2.7."""
GROUPS = ("cross_term_rad", "scale_factor", "own_square_g_per_g2", "product_g_per_g2")
"""Keys of [priors] that are learned."""
Score = Callable[[FloatArray], float]
_STEP = 0.25
_ROUNDS = 40


@dataclass(frozen=True)
class UnitPoses:
    """One unit's poses, linearised about the fit with all terms."""

    known: Known
    fit: ScalarFit

    @staticmethod
    def of(unit: UnitDescription, layout: RecordingLayout, folder: Path) -> UnitPoses:
        """From the recording in its folder.

        Raises
        ------
        RefusedError
            When it cannot be read, or its poses carry no calibration.
        """
        samples = read_samples(folder, layout, unit.temperature_sensor)
        return UnitPoses(*fit_of_all_terms(unit, layout, samples))

    def log_evidence(self, priors: Priors) -> float:
        """Ln of the probability of the poses under other priors, but for a constant."""
        return log_evidence(self.fit, self.known, priors)


@dataclass(frozen=True)
class LearnedPriors:
    """Scales that a series shows.

    Attributes
    ----------
    priors : Priors
    factors : dict
        By key: factor within which the scale is known, of one standard deviation.
    units : int
    log_evidence, log_evidence_before : float
        With these priors and with the defaults; the hyperprior is not in them.
    """

    priors: Priors
    factors: dict[str, float]
    units: int
    log_evidence: float
    log_evidence_before: float

    @property
    def toml(self) -> str:
        """Section [priors] for unit.toml."""
        head = f"[priors]  # learned from {self.units} units"
        lines = [
            f"{key} = {getattr(self.priors, key):.2g}  # within a factor of {self.factors[key]:.2g}"
            for key in GROUPS
        ]
        return "\n".join([head, *lines]) + "\n"


def learn(units: Sequence[UnitPoses]) -> LearnedPriors:
    """The most probable scales."""
    default = Priors()
    start = np.array([math.log(getattr(default, key)) for key in GROUPS])

    def priors_at(log: FloatArray) -> Priors:
        return replace(default, **dict(zip(GROUPS, np.exp(log).tolist(), strict=True)))

    def evidence(log: FloatArray) -> float:
        priors = priors_at(log)
        return math.fsum(unit.log_evidence(priors) for unit in units)

    def score(log: FloatArray) -> float:
        return evidence(log) - 0.5 * float((((log - start) / SPREAD) ** 2).sum())

    log, curvature = _climb(score, start)
    factors = np.exp(1.0 / np.sqrt(np.maximum(curvature, 1.0 / SPREAD**2)))
    return LearnedPriors(
        priors_at(log),
        dict(zip(GROUPS, factors.tolist(), strict=True)),
        len(units),
        evidence(log),
        evidence(start),
    )


def _climb(score: Score, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Maximum of a smooth function, coordinate by coordinate through parabolas; curvatures there.

    A step is at most 1: a factor of 2.7 of a scale.
    """
    at, curvature = start.copy(), np.ones(len(start))
    for _ in range(_ROUNDS):
        moved = 0.0
        for k in range(len(at)):
            side = np.zeros(len(at))
            side[k] = _STEP
            low, middle, high = score(at - side), score(at), score(at + side)
            curvature[k] = (2.0 * middle - low - high) / _STEP**2
            slope = (high - low) / (2.0 * _STEP)
            step = slope / curvature[k] if curvature[k] > 0.05 else math.copysign(0.5, slope)
            step = min(max(step, -1.0), 1.0)
            while abs(step) > 1e-3 and score(at + side / _STEP * step) < middle:
                step *= 0.5
            at[k] += step
            moved = max(moved, abs(step))
        if moved < 0.01:
            break
    return at, curvature
