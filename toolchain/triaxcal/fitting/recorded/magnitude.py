"""Fit of the scalar model to poses, and what is known of its constants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from triaxcal.fitting.core.posterior import fit_map
from triaxcal.fitting.recorded.prior import Known
from triaxcal.fitting.recorded.scalar import (
    ScalarData,
    ScalarModel,
    constant_part,
    residual_of,
)
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.types import FloatArray

_STEPS_MAX = 60
_STEPS_NEAR = 12
_SETTLED = 1e-13
"""Of the scaled constants, which are about 1: rounding."""


def fit_scalar(
    model: ScalarModel,
    data: ScalarData,
    gain_functions: int,
    loss: str = "linear",
    start: FloatArray | None = None,
) -> ScalarFit:
    """Solve for the constants of `model`.

    Parameters
    ----------
    gain_functions : int
        How many functions of temperature, the first ones, the entries of K have.
    loss : str
        One of `unit.choices.LOSSES`; the robust ones turn at three robust deviations.
    start : array or None
        Theta to start from; None is K = 1 and no bias, in scaled readings.
    """
    first = _start(model, data, gain_functions) if start is None else start

    def residual(theta: FloatArray) -> FloatArray:
        return residual_of(model, gain_functions, data, theta)[0] * data.weight

    def jacobian(theta: FloatArray) -> FloatArray:
        return residual_of(model, gain_functions, data, theta)[1] * data.weight[:, None]

    def both(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        errors, slopes = residual_of(model, gain_functions, data, theta)
        return errors * data.weight, slopes * data.weight[:, None]

    if start is not None and loss == "linear":
        theta = _gauss_newton(both, first)
        if theta is not None:
            return _fitted(model, gain_functions, data, theta)
    from scipy.optimize import least_squares  # noqa: PLC0415

    # trf takes fewer poses than parameters: the minimum-norm step; the condition number shows it.
    solve = partial(
        least_squares,
        residual,
        jac=jacobian,
        method="trf",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-15,
        max_nfev=_STEPS_MAX,
    )
    found = solve(first)
    if loss != "linear":
        scale = 3.0 * 1.4826 * float(np.median(np.abs(found.fun))) or 1e-9
        found = solve(found.x, loss="huber" if loss == "huber" else "cauchy", f_scale=scale)
    return _fitted(model, gain_functions, data, np.asarray(found.x, dtype=np.float64))


def fit_with_prior(
    model: ScalarModel,
    data: ScalarData,
    gain_functions: int,
    known: Known,
    *,
    loss: str = "linear",
    near: ScalarFit | None = None,
) -> ScalarFit:
    """The most probable constants of `model`, by all that is known beforehand.

    `near` is a fit of more poses: its solution is the start, and its noise is taken.
    """
    prior = known.of(model, data, gain_functions)
    start: FloatArray | None = None
    scale: float | None = None
    if near is not None and near.posterior is not None:
        of = near.posterior
        prior, scale = of.prior, of.scale
        away = np.linalg.lstsq(prior.factor, near.theta - prior.mean, rcond=None)[0]
        start = np.asarray(away, dtype=np.float64)
    posterior = fit_map(
        lambda theta: residual_of(model, gain_functions, data, theta),
        prior,
        data.weight,
        known.noise,
        values=data.values,
        start=start,
        scale=scale,
        loss=loss,
    )
    found = _fitted(model, gain_functions, data, posterior.theta)
    return replace(found, posterior=posterior)


def _fitted(
    model: ScalarModel, gain_functions: int, data: ScalarData, theta: FloatArray
) -> ScalarFit:
    errors, slopes = residual_of(model, gain_functions, data, theta)
    return ScalarFit(model, gain_functions, theta, data, slopes * data.weight[:, None], errors)


def _gauss_newton(
    both: Callable[[FloatArray], tuple[FloatArray, FloatArray]], start: FloatArray
) -> FloatArray | None:
    """Solution from a near start in a few steps; None when they do not settle."""
    theta = start
    for _ in range(_STEPS_NEAR):
        errors, slopes = both(theta)
        step = np.linalg.lstsq(slopes, -errors, rcond=1e-10)[0]
        theta = (theta + step).astype(np.float64)
        if np.abs(step).max() < _SETTLED:
            return theta
    return None


def _start(model: ScalarModel, data: ScalarData, gain_functions: int) -> FloatArray:
    P = data.basis.shape[1]
    ones = constant_part(data.basis)
    gains = np.zeros((len(model.gain), gain_functions))
    diagonal = np.trace(model.gain, axis1=1, axis2=2) > 0.0
    gains[diagonal] = ones[:gain_functions] / data.gravity_g
    return np.concatenate([gains.ravel(), np.zeros(3 * P + len(model.quadratic))])
