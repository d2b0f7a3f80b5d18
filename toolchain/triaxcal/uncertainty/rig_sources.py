"""Sources at the calibration: noise, placement, gravity, thermometer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import RADIANS_PER_ARCSEC, Curves, Propagation, mapped
from triaxcal.uncertainty.scatter import Scatter
from triaxcal.uncertainty.source import ASSUMED_DOF, NORMAL, STUDENT, Source, from_factor
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

LEVEL_ARCSEC = 20.0
GRAVITY_M_PER_S2 = 5e-5
THERMOMETER_DEGC = 0.1
DRIFT_DEGC = 0.02
_WORTH_REPORTING_ARCSEC = 1e-3


def rig_sources(p: Propagation, s: Scatter) -> list[Source]:
    """All sources of a calibration on a tilter but the thermal function's own error."""
    readings = np.einsum("rij,rj->ri", p.dwell_gain, p.forces_g)[:, :, None]
    return [
        _noise(p, s),
        _repeatability(p, s),
        _squareness(p, s),
        _level(p),
        gravity(p, p.constants_factor(readings)),
        *thermometer(p),
    ]


def _noise(p: Propagation, s: Scatter) -> Source:
    """Noise of the readings: independent from dwell to dwell."""
    operator = p.operator
    blocks = np.einsum("nikr,ri,nilr->nikl", operator, s.variance_v2, operator)
    constants = np.zeros((len(p.temps_degc), 3, 4, 3, 4))
    for i in range(3):
        constants[:, i, :, i, :] = blocks[:, i]
    covariance = constants.reshape(-1, 12, 12)
    origin = "dwell statistics, sd / sqrt(count)"
    if p.data.readings.pooled:
        origin += ", sd pooled over the dwells because each has few readings"
    if not s.recorded:
        origin = "scatter of the residuals from temperature to temperature"
        if p.groups == 1:
            origin = "scatter of the residuals; one temperature cannot separate it from placement"
    return Source(
        key="noise",
        name="the noise of the calibration readings",
        unit="V",
        advice="measure longer: four times as long halves it",
        origin=origin,
        sd=math.sqrt(float(np.mean(s.variance_v2))),
        distribution=STUDENT,
        dof=s.noise_dof,
        constants=covariance,
        force=mapped(-p.inverse, covariance),
    )


def _repeatability(p: Propagation, s: Scatter) -> Source:
    """Tilts that are new in each dwell, and whatever else scatters beyond the noise."""
    origin = "scatter of the residuals beyond the dwell statistics"
    if not s.recorded:
        origin = "within the noise: the file has no dwell statistics to separate it"
    elif p.groups == 1:
        origin = "one temperature cannot separate it from squareness"
    return _placement(
        p,
        "repeatability",
        "the dwells' repeatability",
        "let the tilter settle, wait out drifts, repeat the positions",
        np.einsum("nikr,riq->nikrq", p.operator, p.tilt_effect).reshape(len(p.temps_degc), 12, -1),
        (s.repeatability_rad, s.repeatability_dof or 1.0, origin),
    )


def _squareness(p: Propagation, s: Scatter) -> Source:
    """Tilts of the six positions that are the same at all temperatures."""
    origin = "residuals over the positions, the part common to all temperatures"
    least = s.resolution_rad / RADIANS_PER_ARCSEC
    if s.squareness_rad <= s.resolution_rad and least >= _WORTH_REPORTING_ARCSEC:
        origin += f"; below {least:.2g} arcsec it is within the noise"
    each = np.einsum("nikr,riq->nikrq", p.operator, p.tilt_effect)
    return _placement(
        p,
        "squareness",
        "the tilter's squareness",
        "square the tilter's faces, or measure their angles",
        each.reshape(len(p.temps_degc), 12, p.groups, 18).sum(axis=2),
        (s.squareness_rad, s.squareness_dof, origin),
    )


def _placement(  # noqa: PLR0917
    p: Propagation,
    key: str,
    name: str,
    advice: str,
    effect: FloatArray,
    found: tuple[float, float, str],
) -> Source:
    """Tilts as [uncertainty] states them, or as the residuals show: rad, dof and origin."""
    setting = f"{key}_arcsec"
    stated: float | None = getattr(p.unit.stated, setting)
    rad, dof, origin = found
    if stated is not None:
        rad, dof, origin = stated * RADIANS_PER_ARCSEC, math.inf, _from_file(setting)
    constants, force = from_factor(p, effect * rad)
    return Source(
        key=key,
        name=name,
        unit="arcsec",
        advice=advice,
        origin=origin,
        sd=rad / RADIANS_PER_ARCSEC,
        distribution=STUDENT if stated is None else NORMAL,
        dof=dof,
        constants=constants,
        force=force,
    )


def _level(p: Propagation) -> Source:
    """The tilter as a whole, level and mounting: a common rotation that no residual shows."""
    effect = p.constants_factor(p.tilt_effect)
    advice = "level the tilter and seat the unit better, or state how well that is done"
    return _stated(
        p,
        ("level", "the tilter's alignment", "arcsec", advice),
        ("level_arcsec", LEVEL_ARCSEC),
        lambda arcsec: effect * (arcsec * RADIANS_PER_ARCSEC),
    )


def gravity(p: Curves, effect: FloatArray) -> Source:
    """Local gravity; `effect`, shape (n, 12, 1), is what a relative error of one does to [K U0]."""
    advice = "take local gravity from a survey point or measure it"
    return _stated(
        p,
        ("gravity", "local gravity", "m/s²", advice),
        ("gravity_m_per_s2", GRAVITY_M_PER_S2),
        lambda sd: effect * (sd / STANDARD_GRAVITY_M_PER_S2 / p.unit.gravity_g),
    )


def thermometer(p: Curves) -> tuple[Source, Source]:
    """What the thermometer shows wrong at calibration and in use alike, and in use alone.

    The first moves the constants along the curves. The device reads the same thermometer, so that
    the compensated acceleration does not see it. The second moves the acceleration alone.
    """
    slopes = p.slopes.reshape(-1, 12, 1)
    scale = _stated(
        p,
        (
            "thermometer",
            "the thermometer's scale",
            "°C",
            "compare the unit's thermometer with a better one",
        ),
        ("thermometer_degc", THERMOMETER_DEGC),
        lambda sd: -slopes * sd,
    )
    drift = _stated(
        p,
        (
            "thermometer_drift",
            "the thermometer's drift since calibration",
            "°C",
            "use a thermometer that drifts less, or recalibrate sooner",
        ),
        ("thermometer_drift_degc", DRIFT_DEGC),
        lambda sd: slopes * sd,
    )
    return replace(scale, force=None), replace(drift, constants=None)


def _stated(
    p: Curves,
    words: tuple[str, str, str, str],
    setting: tuple[str, float],
    factor: Callable[[float], FloatArray],
) -> Source:
    """A source of the size that a key of [uncertainty] states, or else of its default.

    `words` are its key, name, unit and advice; `factor` gives the factor of [K U0] for a size.
    """
    stated: float | None = getattr(p.unit.stated, setting[0])
    sd = setting[1] if stated is None else stated
    constants, force = from_factor(p, factor(sd))
    return Source(
        *words,
        _from_file(setting[0])
        if stated is not None
        else f"assumed: [uncertainty] {setting[0]} is not given",
        sd,
        NORMAL,
        ASSUMED_DOF if stated is None else math.inf,
        assumed=stated is None,
        constants=constants,
        force=force,
    )


def _from_file(setting: str) -> str:
    return f"unit.toml, [uncertainty] {setting}"
