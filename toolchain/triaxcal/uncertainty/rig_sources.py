"""Sources at the calibration: noise, placement, gravity, thermometer."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import RADIANS_PER_ARCSEC, Curves, Propagation, mapped
from triaxcal.uncertainty.scatter import Scatter
from triaxcal.uncertainty.source import NORMAL, STUDENT, Source, from_factor, stated_or
from triaxcal.unit.description import STANDARD_GRAVITY_M_PER_S2

LEVEL_ARCSEC = 20.0
GRAVITY_M_PER_S2 = 5e-5
THERMOMETER_DEGC = 0.1
DRIFT_DEGC = 0.02
_WORTH_TELLING_ARCSEC = 1e-3


def noise(p: Propagation, s: Scatter) -> Source:
    """Noise of the readings: independent from dwell to dwell."""
    operator = p.operator
    blocks = np.einsum("nikr,ri,nilr->nikl", operator, s.variance_v2, operator)
    constants = np.zeros((len(p.temps_degc), 3, 4, 3, 4))
    for i in range(3):
        constants[:, i, :, i, :] = blocks[:, i]
    covariance = constants.reshape(-1, 12, 12)
    sd_v = math.sqrt(float(np.mean(s.variance_v2)))
    origin = "dwell statistics, sd / sqrt(count)"
    if p.data.readings.pooled:
        origin += ", sd pooled over the dwells: they have few readings"
    if not s.recorded:
        origin = "scatter of the residuals from temperature to temperature"
        if p.groups == 1:
            origin = "scatter of the residuals; one temperature cannot tell it from placement"
    return Source(
        key="noise",
        name="the noise of the calibration readings",
        sd=sd_v,
        unit="V",
        distribution=STUDENT,
        dof=s.noise_dof,
        origin=origin,
        advice="dwell longer: four times as long halves it",
        constants=covariance,
        force=mapped(-p.inverse, covariance),
    )


def repeatability(p: Propagation, s: Scatter) -> Source:
    """Tilts that are new in each dwell, and whatever else scatters beyond the noise."""
    stated = p.unit.stated.repeatability_arcsec
    if stated is not None:
        rad, dof = stated * RADIANS_PER_ARCSEC, math.inf
        origin = "unit.toml, [uncertainty] repeatability_arcsec"
    else:
        rad, dof = s.repeatability_rad, s.repeatability_dof or 1.0
        origin = "scatter of the residuals beyond the dwell statistics"
        if not s.recorded:
            origin = "within the noise: the file has no dwell statistics to tell it apart"
        elif p.groups == 1:
            origin = "not told from squareness by one temperature"
    factor = np.einsum("nikr,riq->nikrq", p.operator, p.tilt_effect) * rad
    constants, force = from_factor(p, factor.reshape(len(p.temps_degc), 12, -1))
    return Source(
        key="repeatability",
        name="the dwells' repeatability",
        sd=rad / RADIANS_PER_ARCSEC,
        unit="arcsec",
        distribution=NORMAL if stated is not None else STUDENT,
        dof=dof,
        origin=origin,
        advice="let the tilter settle, wait out drifts, repeat the positions",
        constants=constants,
        force=force,
    )


def squareness(p: Propagation, s: Scatter) -> Source:
    """Tilts of the six positions that are the same at all temperatures."""
    stated = p.unit.stated.squareness_arcsec
    rad, dof = s.squareness_rad, s.squareness_dof
    origin = "residuals over the positions that stay at all temperatures"
    least = s.resolution_rad / RADIANS_PER_ARCSEC
    if rad <= s.resolution_rad and least >= _WORTH_TELLING_ARCSEC:
        origin += f"; below {least:.2g} arcsec it is not told from noise"
    if stated is not None:
        rad, dof = stated * RADIANS_PER_ARCSEC, math.inf
        origin = "unit.toml, [uncertainty] squareness_arcsec"
    n = len(p.temps_degc)
    each = np.einsum("nikr,riq->nikrq", p.operator, p.tilt_effect)
    factor = each.reshape(n, 12, p.groups, 18).sum(axis=2) * rad
    constants, force = from_factor(p, factor)
    return Source(
        key="squareness",
        name="the tilter's squareness",
        sd=rad / RADIANS_PER_ARCSEC,
        unit="arcsec",
        distribution=NORMAL if stated is not None else STUDENT,
        dof=dof,
        origin=origin,
        advice="square the tilter's faces, or measure their angles",
        constants=constants,
        force=force,
    )


def level(p: Propagation) -> Source:
    """The tilter as a whole, level and mounting: a common rotation that no residual shows."""
    stated = p.unit.stated.level_arcsec
    arcsec, dof, origin = stated_or(stated, LEVEL_ARCSEC, "level_arcsec")
    factor = p.constants_factor(p.tilt_effect) * (arcsec * RADIANS_PER_ARCSEC)
    constants, force = from_factor(p, factor)
    return Source(
        key="level",
        name="the tilter's alignment",
        sd=arcsec,
        unit="arcsec",
        distribution=NORMAL,
        dof=dof,
        origin=origin,
        advice="level the tilter and seat the unit better, or state how well that is done",
        constants=constants,
        force=force,
    )


def gravity(p: Propagation) -> Source:
    """Local gravity: every reading's force is another."""
    readings = np.einsum("rij,rj->ri", p.dwell_gain, p.forces_g)[:, :, None]
    return gravity_by(p, p.constants_factor(readings))


def gravity_by(p: Curves, effect: FloatArray) -> Source:
    """Local gravity; `effect`, shape (n, 12, 1), is what a relative error of one does to [K U0]."""
    stated = p.unit.stated.gravity_m_per_s2
    sd, dof, origin = stated_or(stated, GRAVITY_M_PER_S2, "gravity_m_per_s2")
    relative = sd / STANDARD_GRAVITY_M_PER_S2 / p.unit.gravity_g
    constants, force = from_factor(p, effect * relative)
    return Source(
        key="gravity",
        name="local gravity",
        sd=sd,
        unit="m/s²",
        distribution=NORMAL,
        dof=dof,
        origin=origin,
        advice="take local gravity from a survey point or measure it",
        constants=constants,
        force=force,
    )


def thermometer(p: Curves) -> Source:
    """What the thermometer shows wrong at calibration and in use alike.

    It moves the constants along the curves. The device reads the same thermometer, so that the
    compensated acceleration does not see it.
    """
    stated = p.unit.stated.thermometer_degc
    sd, dof, origin = stated_or(stated, THERMOMETER_DEGC, "thermometer_degc")
    factor = -p.slopes.reshape(-1, 12, 1) * sd
    return Source(
        key="thermometer",
        name="the thermometer's scale",
        sd=sd,
        unit="°C",
        distribution=NORMAL,
        dof=dof,
        origin=origin,
        advice="compare the unit's thermometer with a better one",
        constants=from_factor(p, factor)[0],
        force=None,
    )


def thermometer_drift(p: Curves) -> Source:
    """What the thermometer shows otherwise in use than it did at calibration."""
    stated = p.unit.stated.thermometer_drift_degc
    sd, dof, origin = stated_or(stated, DRIFT_DEGC, "thermometer_drift_degc")
    factor = p.slopes.reshape(-1, 12, 1) * sd
    return Source(
        key="thermometer_drift",
        name="the thermometer's drift since calibration",
        sd=sd,
        unit="°C",
        distribution=NORMAL,
        dof=dof,
        origin=origin,
        advice="use a thermometer that drifts less, or recalibrate sooner",
        constants=None,
        force=from_factor(p, factor)[1],
    )
