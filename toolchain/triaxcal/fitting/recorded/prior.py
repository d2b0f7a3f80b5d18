"""What is known of the constants of |a| = g before any pose, in the fit's own parameters.

`[priors]` of unit.toml speaks of physical constants: cross terms, scale factors against their mean,
own-axis squares, other products, biases. Poses see only some combinations of the products, so the
prior is kept in all 18 of them: what |a| cannot see keeps it, and what |a| sees gets the right one.

Over temperature a constant's function f = sum c_p phi_p(T) has the standard deviation sd for its
mean over the poses. What varies about that mean has, over the poses, the mean variance sd^2 as
well, in equal parts of the other P - 1 functions, whatever functions it is written in: with more
of them a constant varies no more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.fitting.core.noise import NOISE, NoisePrior
from triaxcal.fitting.core.posterior import Prior
from triaxcal.fitting.recorded.scalar import (
    NINE,
    SQUARES,
    ScalarData,
    ScalarModel,
    constant_part,
)
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

_SCALE_UNKNOWN = 0.5
"""Of the mean scale factor where no nominal one is known, against that of the poses."""
_FAR_SDS = 5.0
"""Poses all round that show biases as large: the reading of 0 g is not 0, as of unsigned codes."""

LINEAR = replace(NINE, label="linear, with priors")
OWN_SQUARES = replace(NINE, label="own-axis squares, with priors", quadratic=SQUARES)
FULL = replace(NINE, label="all terms, with priors", quadratic=np.eye(18).reshape(18, 3, 6))


@dataclass(frozen=True)
class Known:
    """What is known of the constants and of the noise before any pose.

    Attributes
    ----------
    priors : Priors
    nominal : float or None
        Reading of 1 g, where the unit of the readings tells it.
    zero : array, shape (3,)
        Readings of 0 g.
    noise : NoisePrior
    """

    priors: Priors
    nominal: float | None
    zero: FloatArray
    noise: NoisePrior = NOISE

    def of(self, model: ScalarModel, data: ScalarData, gain_functions: int) -> Prior:
        """Prior of theta of `fit_scalar`, in scaled readings."""
        p, m = self.priors, len(model.gain)
        P, ones = data.basis.shape[1], constant_part(data.basis)
        known = self.nominal is not None
        # A reading of 1 g in scaled readings; the sphere through the poses has the radius |g|.
        gain = 1.0 / data.gravity_g if self.nominal is None else self.nominal / data.radius
        mean_sd = p.mean_scale if known else _SCALE_UNKNOWN
        diagonal = np.trace(model.gain, axis1=1, axis2=2) > 0.0
        own = np.where(diagonal, p.scale_factor, p.cross_term_rad)
        between = np.diag(own**2)
        common = np.outer(diagonal, diagonal)
        constant = gain**2 * (between + mean_sd**2 * common)
        varying = gain**2 * (between + p.scale_factor**2 * common)
        g = gain_functions
        gains = _over_temperature(constant, varying, data.basis[:, :g], ones[:g])
        zero_sd = p.bias_g * gain
        bias = zero_sd**2 * np.eye(3)
        biases = _over_temperature(bias, bias, data.basis, ones)
        Q = np.where(model.own_square, p.own_square_g_per_g2, p.product_g_per_g2)
        covariance = np.zeros((m * g + 3 * P + len(Q),) * 2)
        covariance[: m * g, : m * g] = gains
        covariance[m * g : m * g + 3 * P, m * g : m * g + 3 * P] = biases
        covariance[m * g + 3 * P :, m * g + 3 * P :] = np.diag(Q**2)
        at_zero = (self.zero - data.centre) / data.radius
        mean = np.concatenate(
            [
                (gain * diagonal[:, None] * ones[:g]).ravel(),
                (at_zero[:, None] * ones).ravel(),
                np.zeros(len(Q)),
            ]
        )
        return Prior.of(mean, covariance)


def reading_of_zero(priors: Priors, rough: ScalarData, *, all_round: bool) -> FloatArray:
    """Readings of 0 g, (3,): 0, unless poses all round show another."""
    far = _FAR_SDS * priors.bias_g / rough.gravity_g * rough.radius
    if all_round and np.linalg.norm(rough.centre) > far:
        return rough.centre
    return np.zeros(3)


def _over_temperature(
    constant: FloatArray, varying: FloatArray, basis: FloatArray, ones: FloatArray
) -> FloatArray:
    """Covariance of functions, constant by constant: their constant part, and what varies."""
    level = np.outer(ones, ones)
    of_constant = np.kron(constant, level)
    if basis.shape[1] == 1:
        return np.asarray(of_constant, dtype=np.float64)
    # Of functions that are orthonormal over the poses, all but the constant 1.
    spread = (np.linalg.pinv(basis.T @ basis / len(basis)) - level) / (basis.shape[1] - 1)
    return np.asarray(of_constant + np.kron(varying, spread), dtype=np.float64)
