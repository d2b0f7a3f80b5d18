"""K3 from poses of which only |a| = g is known."""

from __future__ import annotations

import math
from dataclasses import replace

from triaxcal.fitting.core.cubes import Cubes, cubes_of
from triaxcal.fitting.core.noise import NoisePrior, noise_of
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.metrological import force_from_voltage

_LEAST_G = 1e-7
"""Noise of a pose: cubes show where it is far below what the constants are fitted with at least."""


def scalar_cubes(fit: ScalarFit, noise: NoisePrior) -> Cubes | None:
    """K3 of all three axes, beside the constants of a fit with priors.

    A reading of a_i + K3_i a_i^3 makes |a| - g larger by K3_i a_i^4 / g.
    """
    data, own = fit.data, fit.posterior
    if own is None:
        return None
    constants = data.basis @ fit.constants().T
    force = force_from_voltage(constants, data.reading * data.radius + data.centre)
    columns = force**4 / data.gravity_g * own.weight[:, None]
    J = fit.jacobian * (own.weight / data.weight)[:, None]
    scale = math.exp(noise_of(own.at, replace(noise, least=_LEAST_G)).mean)
    away = own.at.best(scale)
    move = own.prior.mean + own.prior.factor @ away - fit.theta
    spread = replace(own, scale=scale).spread_covariance
    absorbed = J @ (spread @ (J.T @ columns)) / scale**2
    b2 = own.at.singular**2
    dof = own.at.values - float((b2 / (scale**2 + b2)).sum())
    residual = fit.residual_g * own.weight + J @ move
    prior_squares = scale**2 * float(away @ away)
    return cubes_of("xyz", residual, columns, absorbed, dof, prior_squares=prior_squares)
