"""Nonlinear least squares with a Gaussian prior, and the noise scale from the data.

With weighted residuals w r(theta) of standard deviation s, and theta ~ N(m, V) before any reading,
the best theta minimises

    |w r(theta)|^2 / s^2 + (theta - m)^T V^-1 (theta - m).

With V = L L^T and theta = m + L z it is solved in z, which the prior makes well conditioned
whatever the data see. About the solution, B = w J L with singular values b and right singular
vectors E, the marginal likelihood of s is that of N(0, s^2 + B B^T). It is weighed with a
log-normal distribution of s on a grid. Data with many degrees of freedom decide it. With few of
them the interval widens by as much as is unknown of s. The covariance of theta is the sum
of two parts, of independent errors:

    noise:  L E [b^2 s^2 / (s^2 + b^2)^2] E^T L^T,     prior:  L E [s^4 / (s^2 + b^2)^2] E^T L^T.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.noise import NOISE, Linearised, NoisePrior, noise_of
from triaxcal.model.types import FloatArray

Model = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Residuals (n,) and their derivatives (n, p) at a theta (p,)."""
NORMAL_95 = 1.959963984540054
_STEPS_MAX = 60
_SETTLED = 1e-9
"""Of a prior standard deviation."""
_HALVINGS = 12
_TURN = 3.0
_KAPPA = {
    "linear": 1.0,
    "huber": math.erf(_TURN / math.sqrt(2.0)),
    "cauchy": _TURN**2
    - _TURN**3 * math.sqrt(math.pi / 2.0) * math.exp(_TURN**2 / 2.0) * math.erfc(_TURN / 2.0**0.5),
}
"""E[w(x)^2 x^2] of a standard normal x with the weights of `_robust`."""


@dataclass(frozen=True)
class Prior:
    """A normal distribution of the parameters before any reading.

    Attributes
    ----------
    mean : array, shape (p,)
    factor : array, shape (p, k)
        L of the covariance L L^T.
    """

    mean: FloatArray
    factor: FloatArray

    @staticmethod
    def of(mean: FloatArray, covariance: FloatArray) -> Prior:
        """Prior of a covariance (p, p), which may be singular: what has none stays as it is."""
        values, vectors = np.linalg.eigh(covariance)
        kept = values > 1e-14 * max(float(values[-1]), 0.0)
        return Prior(mean, vectors[:, kept] * np.sqrt(values[kept]))

    @property
    def variance(self) -> FloatArray:
        """Of each parameter, shape (p,)."""
        result: FloatArray = (self.factor**2).sum(axis=1)
        return result


@dataclass(frozen=True)
class Posterior:
    """A solution, and what is known of it.

    Attributes
    ----------
    prior : Prior
    theta : array, shape (p,)
    scale : float
        s: noise of a value of weight 1.
    reach : float
        How much wider than 1.96 s the 95 % interval of such a noise is, for s is not known.
    dof : float
        Degrees of freedom with which s is known.
    used : float
        Effective number of constants that the data determine.
    log_evidence : float
        Ln of the probability of the data, but for a constant of their weights.
    weight : array, shape (n,)
        Weights in the end: a robust loss has lowered some.
    at : Linearised
    """

    prior: Prior
    theta: FloatArray
    scale: float
    reach: float
    dof: float
    used: float
    log_evidence: float
    weight: FloatArray
    at: Linearised

    @property
    def half_width(self) -> float:
        """Half the 95 % interval of the noise of a value of weight 1."""
        return NORMAL_95 * self.reach * self.scale

    @cached_property
    def _directions(self) -> FloatArray:
        result: FloatArray = self.prior.factor @ self.at.vectors
        return result

    @cached_property
    def noise_covariance(self) -> FloatArray:
        """Part of the covariance (p, p) that the noise of the data makes, with its `reach`."""
        b2, s2 = self.at.singular**2, self.scale**2
        part = b2 * s2 / (s2 + b2) ** 2 * self.reach**2
        result: FloatArray = (self._directions * part) @ self._directions.T
        return result

    @cached_property
    def prior_covariance(self) -> FloatArray:
        """Part of the covariance (p, p) that is left of the prior."""
        b2, s2 = self.at.singular**2, self.scale**2
        result: FloatArray = (self._directions * (s2 / (s2 + b2)) ** 2) @ self._directions.T
        return result

    @property
    def covariance(self) -> FloatArray:
        """Of theta, (p, p)."""
        result: FloatArray = self.noise_covariance + self.prior_covariance
        return result

    @cached_property
    def spread_covariance(self) -> FloatArray:
        """Covariance (p, p) at the scale itself, without `reach`."""
        b2, s2 = self.at.singular**2, self.scale**2
        result: FloatArray = (self._directions * (s2 / (s2 + b2))) @ self._directions.T
        return result

    def share_of_data(self, of: FloatArray) -> FloatArray:
        """How much the data determine of combinations (..., p) of the parameters, 0 to 1.

        1 - variance now / variance beforehand.
        """
        now = np.einsum("...p,pq,...q->...", of, self.spread_covariance, of)
        before = ((of @ self.prior.factor) ** 2).sum(axis=-1)
        result: FloatArray = np.clip(1.0 - now / np.where(before > 0.0, before, 1.0), 0.0, 1.0)
        return result


def fit_map(
    model: Model,
    prior: Prior,
    weight: FloatArray,
    noise: NoisePrior = NOISE,
    *,
    values: float | None = None,
    start: FloatArray | None = None,
    scale: float | None = None,
    loss: str = "linear",
) -> Posterior:
    """The most probable parameters.

    Parameters
    ----------
    weight : array, shape (n,)
        Square roots of the weights.
    values : float or None
        How many values there are; None for the sum of the squares of `weight`, which counts as one
        what is weighted as one.
    start : array, shape (k,), or None
        z to start from, (theta - m) = L z.
    scale : float or None
        Noise s where it is known; None finds it.
    loss : str
        One of `unit.choices.LOSSES`; the robust ones turn at three robust deviations.
    """
    L, count = prior.factor, float((weight**2).sum()) if values is None else values
    z = np.zeros(L.shape[1]) if start is None else start
    s = noise.median if scale is None else scale
    residual, slopes = model(prior.mean + L @ z)
    for step_number in range(_STEPS_MAX):
        w = weight * _robust(residual * weight, loss) if step_number > 1 else weight
        B, y = w[:, None] * (slopes @ L), w * residual
        at = _consistent(Linearised.about(B, y - B @ z, count), s, loss)
        if scale is None:
            s = math.exp(noise_of(at, noise).mean)
        step = at.best(s) - z
        z, residual, slopes = _line_search(model, prior, w / s, (z, step), residual)
        if np.abs(step).max(initial=0.0) < _SETTLED and (loss == "linear" or step_number > 1):
            break
    w = weight * _robust(residual * weight, loss)
    B = w[:, None] * (slopes @ L)
    at = _consistent(Linearised.about(B, w * residual - B @ z, count), s, loss)
    known = noise_of(at, noise)
    found, reach, dof = math.exp(known.mean), known.half_width() / NORMAL_95, known.dof
    if scale is not None:
        found, reach, dof = scale, 1.0, math.inf
    used = float((at.singular**2 / (found**2 + at.singular**2)).sum())
    theta = prior.mean + L @ z
    return Posterior(prior, theta, found, reach, dof, used, known.log_evidence, w, at)


def _line_search(
    model: Model,
    prior: Prior,
    weight: FloatArray,
    way: tuple[FloatArray, FloatArray],
    residual: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """From z a step, halved until it lowers what is minimised; residual and slopes there."""
    z, step = way
    before = float(((weight * residual) ** 2).sum() + z @ z)
    share = 1.0
    for _ in range(_HALVINGS):
        to = z + share * step
        after, slopes = model(prior.mean + prior.factor @ to)
        cost = float(((weight * after) ** 2).sum() + to @ to)
        if math.isfinite(cost) and cost <= before * (1.0 + 1e-9) + 1e-12:
            break
        share *= 0.5
    return to, after, slopes


def _consistent(at: Linearised, scale: float, loss: str) -> Linearised:
    """The problem with as many values as make s that of normal data, whose squares are lowered."""
    b2 = at.singular**2
    used = float((b2 / (scale**2 + b2)).sum())
    return replace(at, values=at.values - (1.0 - _KAPPA[loss]) * max(at.values - used, 0.0))


def _robust(residual: FloatArray, loss: str) -> FloatArray:
    """Square roots of the weights that a robust loss gives weighted residuals (n,)."""
    if loss == "linear":
        return np.ones(len(residual))
    turn = _TURN * 1.4826 * float(np.median(np.abs(residual))) or 1e-9
    ratio = np.abs(residual) / turn
    if loss == "huber":
        return np.asarray(1.0 / np.sqrt(np.maximum(ratio, 1.0)), dtype=np.float64)
    return np.asarray(1.0 / np.sqrt(1.0 + ratio**2), dtype=np.float64)
