"""The prior of an update: the delivered calibration with all that its budget knows, and a drift.

The covariance of the fit holds at every temperature. The other sources of the budget that act on
the force are alike at all temperatures, each as large as where it is largest: an update at one
temperature corrects them at all. The thermal function's own error is not: it is another at each
temperature, so poses at one say nothing of it elsewhere. It is noise to the poses, and is added to
what is known afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.fitting.field.update import (
    Drift,
    State,
    alike,
    drift_covariance,
    fit_covariance,
    state_of,
)
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.expected import OF_THE_POSE, Expectation, Expected
from triaxcal.uncertainty.explain import Parts
from triaxcal.uncertainty.orientation import DIRECTIONS
from triaxcal.uncertainty.rig_sources import GRAVITY_M_PER_S2
from triaxcal.uncertainty.source import Source
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_OF_THE_FIT = frozenset({"noise", "poses", "priors", "left_out_terms"})
"""In the covariance of the fit itself."""
_OF_ONE_TEMPERATURE = frozenset({"thermal_model", "rate"})
_TEMPERATURES = 9


@dataclass(frozen=True)
class FieldPrior:
    """What is known of a calibration's parameters before the poses.

    Attributes
    ----------
    state : State
    factory : array, shape (p, p)
        Covariance of theta of the delivered calibration.
    allowed : array, shape (p, p)
        With the allowance for drift.
    thermal : array, shape (p, p)
        Of the thermal function's own error, which the poses do not lower.
    """

    state: State
    factory: FloatArray
    allowed: FloatArray
    thermal: FloatArray

    def length_g(self, covariance: FloatArray, t0_degc: float) -> float:
        """Standard uncertainty of |a| at T0, rms over all orientations of 1 g, in g."""
        state = self.state
        K, U0 = unpack_constants(state.calibration.thermal.constants_at(t0_degc))
        readings, temps = DIRECTIONS @ K.T + U0, np.full(len(DIRECTIONS), t0_degc)
        slopes = state.length(state.theta, readings, temps)[1]
        variance = np.einsum("np,pq,nq->n", slopes, covariance, slopes)
        return float(np.sqrt(np.mean(np.maximum(variance, 0.0))))


def field_prior(parts: Parts, drift: Drift) -> FieldPrior:
    """Prior of a calibration whose sensor may have drifted since."""
    unit, measurements, calibration = parts
    state = state_of(calibration)
    grid = np.unique([*np.linspace(*calibration.range_degc, _TEMPERATURES), unit.t0_degc])
    K = unpack_constants(calibration.thermal.constants_at(grid))[0]
    shared, thermal = np.zeros((30, 30)), np.zeros((30, 30))
    for s in uncertainty(unit, measurements, calibration, None, grid).sources:
        if s.force is None or s.key in OF_THE_POSE or s.key in _OF_THE_FIT:
            continue
        if s.key not in _OF_ONE_TEMPERATURE:
            shared += _largest(s, K)
        elif s.key == "thermal_model":  # the source of the rate remains one after the update
            thermal += _largest(s, K)
    factory = fit_covariance(state) + alike(state, shared)
    allowed = factory + drift_covariance(state, drift)
    return FieldPrior(state, factory, allowed, alike(state, thermal))


def noise_of_poses(
    unit: UnitDescription, expects: Expectation, poses: FieldPoses, new: Expected
) -> FloatArray:
    """Covariance (n, n) of |a| - g at the poses that the constants have no part in, g^2.

    What is new in each pose, local gravity, which all share, and the thermal function's error.
    """
    stated = unit.stated.gravity_m_per_s2
    gravity_sd = (GRAVITY_M_PER_S2 if stated is None else stated) / STANDARD_GRAVITY_M_PER_S2
    noise: FloatArray = np.diag(new.own_sd_g**2) + gravity_sd**2
    for key in _OF_ONE_TEMPERATURE & expects.roots.keys():
        F = expects.factor(key, poses, new.force_g)
        noise += F @ F.T
    return noise


def _largest(source: Source, K: FloatArray) -> FloatArray:
    """Covariance (30, 30) of constants and Q of a source, at the temperature where it is largest.

    From D = [-N dK, -N dU0, dQ], row by row: dK = -K D, dU0 = -K D.
    """
    assert source.force is not None
    worst = int(np.trace(source.force, axis1=1, axis2=2).argmax())
    columns = source.force.shape[-1] // 3
    to_theta = np.zeros((30, 3, columns))
    for i in range(3):
        for j in range(3):
            to_theta[3 * i + j, :, j] = -K[worst, i]
        to_theta[9 + i, :, 3] = -K[worst, i]
        if columns > 4:
            to_theta[12 + 6 * i : 18 + 6 * i, i, 4:] = np.eye(6)
    map_ = to_theta.reshape(30, -1)
    result: FloatArray = map_ @ source.force[worst] @ map_.T
    return result
