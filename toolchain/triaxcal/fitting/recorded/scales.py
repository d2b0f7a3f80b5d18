"""Scales of the priors under which poses are most probable: of one unit, or of a series together.

The standard deviations of the groups of constants are themselves known to a factor only. The
marginal likelihood of a scale is the probability of the poses with the constants integrated out,
which is exact for the fit linearised about its solution, and with the noise integrated out, on a
grid. A hyperprior, log-normal with `SPREAD` about the stated scale, holds what the poses do not
show. The probability of the poses under a whole model integrates the scales as well, by Laplace's
approximation along each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.noise import Linearised, noise_of
from triaxcal.fitting.core.posterior import Posterior
from triaxcal.fitting.recorded.prior import Known
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

SPREAD = 1.0
"""Standard deviation of ln(scale / stated): a factor of 2.7."""
Score = Callable[[FloatArray], float]
_COARSE = (-2.4, -1.6, -0.8, 0.0, 0.8, 1.6)
"""Ln of the factors that are tried first: the likelihood of a scale may have two maxima."""
MOST_OF_A_UNIT = 2.0
"""Standard deviations by which the scale of one unit may exceed the stated one: beyond, its poses
contradict it, which is said (`recorded.contradicted`) and not healed. A series has no such limit:
its stated scales are the defaults, of sensors of any type."""
_STEP = 0.25
_ROUNDS = 40
_SETTLED = 0.02
"""Of ln(scale): 2 % of a scale changes no constant by a noticeable part of its uncertainty."""


@dataclass(frozen=True)
class ScaleEvidence:
    """One unit's poses, linearised about a fit with priors.

    Attributes
    ----------
    known : Known
    fit : ScalarFit
    weighed : Posterior or None
        Whose weights the poses have, and whose count: fits with a robust loss are compared with
        those of one of them, for each lowers the weights of what it does not explain itself. None
        for the fit's own.
    """

    known: Known
    fit: ScalarFit
    weighed: Posterior | None = None

    @cached_property
    def _triangle(self) -> tuple[FloatArray, FloatArray, float]:
        """Weighted slopes and residuals, as a triangle where rows are many, and their count."""
        fit, weighed = self.fit, self.weighed or self.fit.posterior
        assert weighed is not None
        slopes = fit.jacobian * (weighed.weight / fit.data.weight)[:, None]
        rows = np.column_stack([slopes, weighed.weight * fit.residual_g])
        if len(rows) > rows.shape[1]:
            rows = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
        return rows[:, :-1], rows[:, -1], weighed.at.values

    def log_evidence(self, priors: Priors) -> float:
        """Ln of the probability of the poses under other priors, but for a constant."""
        fit = self.fit
        prior = replace(self.known, priors=priors).of(fit.model, fit.data, fit.gain_functions)
        slopes, residual, count = self._triangle
        at_mean = residual + slopes @ (prior.mean - fit.theta)
        at = Linearised.about(slopes @ prior.factor, at_mean, count)
        return noise_of(at, self.known.noise).log_evidence


@dataclass(frozen=True)
class Scales:
    """The most probable scales.

    Attributes
    ----------
    priors : Priors
    factors : dict
        By key: factor within which the scale is known, of one standard deviation, the others
        being unknown as well. Keys whose scale is at its limit have none.
    log_evidence : float
        Ln of the probability of the poses, scales integrated out, but for a constant.
    """

    priors: Priors
    factors: dict[str, float]
    log_evidence: float


def scales_of(units: Sequence[ScaleEvidence], stated: Priors, most: float = math.inf) -> Scales:
    """The scales under which the poses of all units together are most probable.

    `most` is by how many standard deviations of the hyperprior a scale may exceed the stated one.
    The probability and the factors are those about the maximum without that limit: at the limit
    the evidence still rises, and its curvature there says nothing.
    """
    keys = max((unit.fit.model.groups for unit in units), key=len)
    start = np.array([math.log(getattr(stated, key)) for key in keys])

    def priors_at(away: FloatArray) -> Priors:
        found = np.exp(start + SPREAD * away).tolist()
        return replace(stated, **dict(zip(keys, found, strict=True)))

    known: dict[bytes, float] = {}

    def score(away: FloatArray) -> float:
        key = away.tobytes()
        if key not in known:
            priors = priors_at(away)
            evidence = math.fsum(unit.log_evidence(priors) for unit in units)
            known[key] = evidence - 0.5 * float((away**2).sum())
        return known[key]

    top = _climb(score, _coarse(score, len(keys)))
    curvature = _curvature(score, top)
    # Over coordinates with a standard normal prior, the integral is the top over the root of the
    # determinant; a flat likelihood has 1.
    volume = 0.5 * math.log(float(np.linalg.det(curvature)))
    sd = np.sqrt(np.diag(np.linalg.inv(curvature)))
    factors = dict(zip(keys, np.exp(SPREAD * sd).tolist(), strict=True))
    away = top if top.max() <= most else _climb(score, np.minimum(top, most), most)
    free = {key: factors[key] for key, at in zip(keys, away, strict=True) if at < most}
    return Scales(priors_at(away), free, score(top) - volume)


def _coarse(score: Score, count: int) -> FloatArray:
    """The best of a coarse grid, coordinate by coordinate."""
    at = np.zeros(count)
    for k in range(count):
        tried = np.array([np.where(np.arange(count) == k, step, at) for step in _COARSE])
        at = tried[int(np.argmax([score(row) for row in tried]))]
    return at


def _climb(score: Score, start: FloatArray, most: float = math.inf) -> FloatArray:
    """Maximum of a smooth function up to `most`, coordinate by coordinate through parabolas.

    A step is at most 1: a factor of 2.7 of a scale.
    """
    at = start.copy()
    for _ in range(_ROUNDS):
        moved = 0.0
        for k in range(len(at)):
            side = np.zeros(len(at))
            side[k] = _STEP
            low, middle, high = score(at - side), score(at), score(at + side)
            curvature = (2.0 * middle - low - high) / _STEP**2
            slope = (high - low) / (2.0 * _STEP)
            step = slope / curvature if curvature > 0.05 else math.copysign(0.5, slope)
            step = min(max(step, -1.0), 1.0, most - at[k])
            while abs(step) > 1e-3 and score(at + side / _STEP * step) < middle:
                step *= 0.5
            at[k] += step
            moved = max(moved, abs(step))
        if moved < _SETTLED:
            break
    return at


def _curvature(score: Score, at: FloatArray) -> FloatArray:
    """Minus the second derivatives, (k, k), by differences over `_STEP`.

    At least 0.5, half of the hyperprior's: a likelihood may be convex where the poses show little.
    """
    count, top = len(at), score(at)
    side = _STEP * np.eye(count)
    single = [(score(at + s), score(at - s)) for s in side]
    matrix = np.zeros((count, count))
    for i in range(count):
        matrix[i, i] = (2.0 * top - sum(single[i])) / _STEP**2
        for j in range(i):
            both = score(at + side[i] + side[j]) + score(at - side[i] - side[j])
            matrix[i, j] = matrix[j, i] = (sum(single[i]) + sum(single[j]) - 2.0 * top - both) / (
                2.0 * _STEP**2
            )
    values, vectors = np.linalg.eigh(matrix)
    result: FloatArray = (vectors * np.maximum(values, 0.5)) @ vectors.T
    return result
