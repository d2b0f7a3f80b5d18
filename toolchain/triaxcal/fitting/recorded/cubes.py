"""K3 from poses of which only |a| = g is known."""

from __future__ import annotations

from triaxcal.fitting.core.cubes import Cubes, cubes_of
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.metrological import force_from_voltage


def scalar_cubes(fit: ScalarFit) -> Cubes | None:
    """K3 of all three axes, beside the constants of a fit with priors.

    A reading of a_i + K3_i a_i^3 makes |a| - g larger by K3_i a_i^4 / g.
    """
    data, posterior = fit.data, fit.posterior
    if posterior is None:
        return None
    constants = data.basis @ fit.constants().T
    force = force_from_voltage(constants, data.reading * data.radius + data.centre)
    weight = posterior.weight
    columns = force**4 / data.gravity_g * weight[:, None]
    J = fit.jacobian * (weight / data.weight)[:, None]
    absorbed = J @ (posterior.spread_covariance @ (J.T @ columns)) / posterior.scale**2
    dof = posterior.at.values - posterior.used
    return cubes_of("xyz", fit.residual_g * weight, columns, absorbed, dof)
