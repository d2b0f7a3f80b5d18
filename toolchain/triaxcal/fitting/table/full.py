"""All terms of P0 (13) with stated priors: what few positions leave open is bounded.

A grid that sees one direction of the unknowns badly then predicts as well as it can, and the
standard deviations say what the data leave to the prior. Each axis has its own noise, from its
residuals over the degrees of freedom that the prior leaves. Held-out errors are those of a linear
fit, (1 - H)^-1 times the residuals of what is held out: the model departs from linear by the square
of a change that is already small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.table.allterms import AllTerms, prior_rows, quadratic_sd
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.unit.priors import Priors

_ROUNDS = 12
_SETTLED = 1e-10
"""Of the force, g: a round that changes no pose by more is the last."""
NOISE_MIN_G = 1e-6
"""Square of a Q of 1 mg/g^2: what a model of second order leaves out must not outweigh a prior."""
_FEW = 5.0
"""Degrees of freedom of one axis: with fewer the axes share one noise."""
_LEVERAGE_MAX = 1.0 - 1e-9
"""Of what is held out: beyond, the rest leaves it open."""


@dataclass(frozen=True)
class FullFit:
    """Constants and Q with their covariance.

    Attributes
    ----------
    constants : array, shape (12, P)
        By function of the shape, in the order of `CONSTANT_NAMES`.
    quadratic : array, shape (3, 6)
        Without the part that was known.
    covariance : array, shape (12, P, 12, P)
    quadratic_covariance : array, shape (18, 18)
    cross : array, shape (12, P, 18)
    noise_g : array, shape (3,)
        Of one component.
    effective : array, shape (3,)
        Parameters that the data determine, of each axis.
    by_data : array, shape (3, 6)
        Share of Q that the data determine: 1 less the variance over that of the prior.
    condition : float
        Of the design with its priors, columns scaled to length 1.
    errors_g : array, shape (m, 3), or None
        Of what was held out, in its order; None where the rest leaves it open.
    """

    constants: FloatArray
    quadratic: FloatArray
    covariance: FloatArray
    quadratic_covariance: FloatArray
    cross: FloatArray
    noise_g: FloatArray
    effective: FloatArray
    by_data: FloatArray
    condition: float
    errors_g: FloatArray | None


@dataclass(frozen=True)
class _Round:
    """One round: unknowns, noise (3,), and the design with its priors, columns of length 1.

    Attributes
    ----------
    slopes : array, shape (n, 3, unknowns)
    design, scale : arrays
        Rows of the poses over their noise, then those of the prior; the columns' lengths.
    """

    theta: FloatArray
    noise: FloatArray
    slopes: FloatArray
    design: FloatArray
    scale: FloatArray

    @staticmethod
    def of(problem: AllTerms, theta: FloatArray, noise: FloatArray, weight: FloatArray) -> _Round:
        """The round at given unknowns; `weight` are the rows of the prior."""
        slopes = problem.slopes(theta)
        rows = (slopes / noise[:, None]).reshape(-1, slopes.shape[-1])
        design = np.concatenate([rows, weight])
        scale = np.linalg.norm(design, axis=0)
        scale[scale == 0.0] = 1.0
        return _Round(theta, noise, slopes, design / scale, scale)

    def covariance(self) -> FloatArray:
        """Of the unknowns."""
        inverse = np.linalg.pinv(np.linalg.qr(self.design, mode="r")) / self.scale[:, None]
        result: FloatArray = inverse @ inverse.T
        return result

    def effective(self, covariance: FloatArray) -> FloatArray:
        """Trace of the hat matrix, by axis."""
        hat = np.einsum("nip,pq,niq->i", self.slopes, covariance, self.slopes, optimize=True)
        result: FloatArray = hat / self.noise**2
        return result


def fit_full(
    problem: AllTerms,
    start: FloatArray,
    priors: Priors,
    left_out: Sequence[BoolArray] = (),
) -> FullFit:
    """Fit all terms to poses whose force is known.

    Parameters
    ----------
    start : array, shape (12, P)
        Constants of a linear fit.
    left_out : masks, each (n,)
        What is held out in turn.
    """
    theta, force = problem.unknowns(start), problem.force
    weight, aim = prior_rows(problem, start, priors)
    before = problem.force_of(theta)[1]
    noise = _noise(force - before, np.full(3, float(len(force))))
    for _ in range(_ROUNDS):
        step = _Round.of(problem, theta, noise, weight)
        right = np.concatenate([((force - before) / noise).ravel(), aim - weight @ theta])
        theta = theta + np.linalg.lstsq(step.design, right, rcond=None)[0] / step.scale
        now = problem.force_of(theta)[1]
        found = _noise(force - now, len(force) - step.effective(step.covariance()))
        settled = np.abs(now - before).max() < _SETTLED and np.allclose(found, noise, rtol=1e-3)
        noise, before = found, now
        if settled:
            break
    return _result(problem, _Round.of(problem, theta, noise, weight), priors, left_out)


def _noise(residual: FloatArray, free: FloatArray) -> FloatArray:
    """Noise of each axis from residuals (n, 3) and their degrees of freedom (3,)."""
    squares = (residual**2).sum(axis=0)
    if float(free.min()) < _FEW:
        squares, free = np.full(3, squares.sum()), np.full(3, free.sum())
    noise = np.sqrt(squares / np.maximum(free, 1.0))
    result: FloatArray = np.maximum(noise, NOISE_MIN_G)
    return result


def _result(
    problem: AllTerms, last: _Round, priors: Priors, left_out: Sequence[BoolArray]
) -> FullFit:
    covariance = last.covariance()
    count, at = problem.basis.shape[1], problem.linear
    # The unknowns of K are `gains` of its P parameters.
    full = np.stack([problem.constants(row).ravel() for row in np.eye(at, at + 18)], axis=1)
    of_q = covariance[at:, at:]
    return FullFit(
        constants=problem.constants(last.theta),
        quadratic=last.theta[at:].reshape(3, 6),
        covariance=(full @ covariance[:at, :at] @ full.T).reshape(12, count, 12, count),
        quadratic_covariance=of_q,
        cross=(full @ covariance[:at, at:]).reshape(12, count, 18),
        noise_g=last.noise,
        effective=last.effective(covariance),
        by_data=1.0 - np.diag(of_q).reshape(3, 6) / quadratic_sd(priors) ** 2,
        condition=float(np.linalg.cond(last.design)),
        errors_g=_held_out(problem, last, covariance, left_out),
    )


def _held_out(
    problem: AllTerms, last: _Round, covariance: FloatArray, left_out: Sequence[BoolArray]
) -> FloatArray | None:
    """Errors of what is held out in turn; None where the rest leaves one of them open."""
    error = (problem.force_of(last.theta)[1] - problem.force) / last.noise
    every = last.slopes / last.noise[:, None]
    found = []
    for mask in left_out:
        J = every[mask].reshape(-1, every.shape[-1])
        H = J @ covariance @ J.T
        if float(np.linalg.eigvalsh(H)[-1]) > _LEVERAGE_MAX:
            return None
        out = np.linalg.solve(np.eye(len(H)) - H, error[mask].ravel())
        found.append(out.reshape(-1, 3) * last.noise)
    return np.concatenate(found) if found else None
