"""The thermal function's own error: from held-out data, or from a rival where there are none."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.fitting.tilter.curves import fit_curves
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.uncertainty.heldout import thermal_error
from triaxcal.uncertainty.propagation import Propagation, rows_of
from triaxcal.uncertainty.scatter import Scatter
from triaxcal.uncertainty.source import (
    ASSUMED_DOF,
    RECTANGULAR,
    STUDENT,
    Source,
    direct,
    from_factor,
)

_NAMED = ("thermal_model", "the thermal model", "g")
_ADVICE = "measure at one more temperature, or check positions at temperatures in between"


def thermal_model(p: Propagation, s: Scatter) -> Source:
    """Error of the thermal function."""
    error = thermal_error(p, s)
    if error is None:
        return _without_held_out(p)
    n = len(p.temps_degc)
    # As an error of the force in each of the six positions at one temperature, so of the readings.
    readings = np.sum(p.rows[:, :, :3] ** 2, axis=2) * error.sd_g**2
    gain = np.mean(np.sum(p.data.operators[0] ** 2, axis=-1), axis=0)
    constants = np.zeros((n, 12, 12))
    constants[:, range(12), range(12)] = (readings[:, :, None] * gain).reshape(n, 12)
    seen = f"held-out error beyond noise and placement, {error.dof:.0f} values"
    if error.sd_g < error.resolution_g:
        seen += f"; below {error.resolution_g * 1e6:.2g} µg it is within the noise"
    return Source(
        *_NAMED,
        "measure at one more temperature, or choose a better thermal function",
        seen,
        error.sd_g,
        STUDENT,
        error.dof,
        constants=constants,
        force=direct(p, np.broadcast_to(np.eye(3) * error.sd_g, (n, 3, 3))),
    )


def _without_held_out(p: Propagation) -> Source:
    """The distance to another function through the same points, if there is one."""
    rival = _rival(p)
    if rival is None:
        return Source(
            *_NAMED,
            _ADVICE,
            "unknown: nothing was held out, and no other function fits to compare with",
        )
    parameters = fit_curves(p.data, rival)[0]
    constants = rival.model(parameters).constants_at(p.temps_degc)
    difference = rows_of(constants) - p.rows
    factor = difference.reshape(-1, 12, 1) / math.sqrt(3.0)
    force = p.force_factor(factor).reshape(-1, 3, 4)
    largest = float(np.max(np.linalg.norm(force, axis=-1)))
    return Source(
        *_NAMED,
        _ADVICE,
        f"not known: nothing was held out; taken from the distance to a {rival.label} "
        "through the same readings",
        largest,
        RECTANGULAR,
        ASSUMED_DOF,
        True,
        *from_factor(p, factor),
    )


def _rival(p: Propagation) -> ThermalShape | None:
    """Another function that the temperatures determine exactly."""
    temps, t0 = p.data.readings.temps_degc, p.unit.t0_degc
    exact = (f.exact(temps, t0) for f in THERMAL_FUNCTIONS if len(temps) >= max(3, f.least_temps))
    return next((shape for shape in exact if shape != p.calibration.shape), None)
