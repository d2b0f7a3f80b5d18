"""How much of the held-out error is the thermal function's and not noise or placement.

The errors h at held-out readings (fitting.tilter.selection: temperatures held out in turn,
check dwells) are linear in the errors of all readings, h = A dU + their own. Fixed tilts of the
positions would show in h without being any fault of the curve: what they can make is projected
out first. Of the rest,

    (|P h|^2 - trace P cov P) / (n - rank)

estimates the variance that the thermal function adds to a component of the force, cov being the
noise of the readings and the repeatability of the dwells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.tilter.curves import fit_curves, parameter_operator
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.thermal.shape import EDGE_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import Propagation
from triaxcal.uncertainty.scatter import Scatter


@dataclass(frozen=True)
class HeldOut:
    """Errors at held-out values and what makes them.

    Attributes
    ----------
    errors_g : array, shape (n,)
    operator : array, shape (n, 6 G, 3)
        A, in g/V.
    own_variance_g2 : array, shape (n,)
        Noise of the held-out reading itself, where it is none of the 6 G.
    """

    errors_g: FloatArray
    operator: FloatArray
    own_variance_g2: FloatArray


@dataclass(frozen=True)
class ThermalError:
    """Standard uncertainty that the thermal function adds to a component of the force.

    `resolution_g` is what the held-out values cannot separate from noise: their standard
    error.
    """

    sd_g: float
    dof: float
    resolution_g: float


def thermal_error(p: Propagation, s: Scatter) -> ThermalError | None:
    """Error of the thermal function; None where nothing can be held out."""
    held = held_out(p, s)
    count = len(held.errors_g)
    if not count:
        return None
    tilts = _tilt_modes(p)
    modes = np.einsum("vri,rim->vm", held.operator, tilts)
    U, singular, _ = np.linalg.svd(modes, full_matrices=False)
    U = U[:, singular > 1e-6 * max(float(singular.max()), 1e-300)]
    dof = count - U.shape[1]
    if dof <= 0:
        return None
    errors = held.errors_g - U @ (U.T @ held.errors_g)
    flat = held.operator.reshape(count, -1)
    noise = flat - U @ (U.T @ flat)
    per_dwell = np.einsum("vri,riq->vrq", held.operator, p.tilt_effect).reshape(count, -1)
    placement = per_dwell - U @ (U.T @ per_dwell)
    explained = float(np.sum(noise**2 * s.variance_v2.reshape(-1)))
    explained += s.repeatability_rad**2 * float(np.sum(placement**2))
    explained += float(np.sum((1.0 - np.sum(U**2, axis=1)) * held.own_variance_g2))
    seen = float(errors @ errors) / dof
    excess = seen - explained / dof
    resolution = math.sqrt(seen * math.sqrt(2.0 / dof))
    return ThermalError(math.sqrt(max(excess, 0.0)), float(dof), resolution)


def held_out(p: Propagation, s: Scatter) -> HeldOut:
    """All held-out errors of the chosen function and estimator, as fit.selection scores them."""
    parts = [*_left_out(p), _checks(p, s)]
    return HeldOut(
        errors_g=np.concatenate([part.errors_g for part in parts]),
        operator=np.concatenate([part.operator for part in parts]),
        own_variance_g2=np.concatenate([part.own_variance_g2 for part in parts]),
    )


def _left_out(p: Propagation) -> list[HeldOut]:
    count = p.groups
    return [_fold(p, g) for g in range(1, count - 1)] if count >= 4 else []


def _fold(p: Propagation, left_out: int) -> HeldOut:
    """The 18 errors at one temperature, of curves fitted without it."""
    kept = [g for g in range(p.groups) if g != left_out]
    remaining, group = p.data.select(kept), p.data.readings.select([left_out])
    temps = remaining.readings.temps_degc
    shape = p.calibration.shape.without(temps, float(group.temps_degc[0]))
    parameters = fit_curves(remaining, shape)[0]
    basis = shape.basis(group.dwell_temps_degc[0])
    constants = basis @ parameters.T
    force = p.forces_g[:6]
    errors = force_from_voltage(constants, group.voltage_v[0]) - force
    N = np.linalg.inv(unpack_constants(constants)[0])
    design = np.column_stack([force, np.ones(6)])
    predicted = np.einsum("dk,jkpr,dp->djr", design, parameter_operator(remaining, shape)[0], basis)
    readings = np.zeros((6, 3, 6 * p.groups))
    columns = np.concatenate([np.arange(6 * g, 6 * g + 6) for g in kept])
    readings[:, :, columns] = -predicted
    for d in range(6):
        readings[d, :, 6 * left_out + d] = 1.0
    operator = np.einsum("dij,djr->dirj", N, readings)
    return HeldOut(errors.reshape(18), operator.reshape(18, -1, 3), np.zeros(18))


def _checks(p: Propagation, s: Scatter) -> HeldOut:
    """|a| - g at the check dwells within the calibrated temperatures."""
    temps = p.data.readings.temps_degc
    results = [
        c
        for c in p.calibration.check_dwells
        if temps[0] - EDGE_DEGC <= c.dwell.temp_degc <= temps[-1] + EDGE_DEGC
    ]
    if not results:
        return HeldOut(np.zeros(0), np.zeros((0, 6 * p.groups, 3)), np.zeros(0))
    at = np.array([c.dwell.temp_degc for c in results])
    constants = p.calibration.thermal.constants_at(at)
    voltage = np.array([c.dwell.voltage_v for c in results])
    force = p.calibration.terms.force_g(force_from_voltage(constants, voltage))
    # Products change the slope of |a| by their own size, some 1e-4 of it, which is left out.
    along = force / np.linalg.norm(force, axis=1, keepdims=True)
    row = np.einsum("ci,cij->cj", along, np.linalg.inv(unpack_constants(constants)[0]))
    design = np.column_stack([force, np.ones(len(force))])
    operator = -np.einsum("cj,cjkr,ck->crj", row, p.constants_operator(at), design)
    typical = s.variance_v2.mean(axis=0)
    known = [c.dwell.variance_of_mean_v2 for c in results]
    own = np.array([typical if v is None else v for v in known])
    errors = np.array([c.error_g for c in results])
    return HeldOut(errors, operator, np.sum(row**2 * own, axis=1))


def _tilt_modes(p: Propagation) -> FloatArray:
    """Fixed tilts of the six positions about three axes, (6 G, 3, 18), V/rad."""
    modes = np.zeros((p.groups, 6, 3, 6, 3))
    effect = p.tilt_effect.reshape(p.groups, 6, 3, 3)
    for d in range(6):
        modes[:, d, :, d, :] = effect[:, d]
    return modes.reshape(6 * p.groups, 3, 18)
