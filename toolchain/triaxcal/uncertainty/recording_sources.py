"""Sources of a calibration from a recording: the poses' scatter, gravity, thermometer, held out."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.fitting.core.recorded import (
    LEFT_OUT_PART,
    NOISE_PART,
    PRIOR_PART,
    CovariancePart,
    RecordingFit,
)
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance
from triaxcal.uncertainty.propagation import ROWS, Curves, mapped
from triaxcal.uncertainty.rig_sources import gravity, thermometer
from triaxcal.uncertainty.source import NORMAL, STUDENT, Source, direct
from triaxcal.uncertainty.terms_sources import rate_source, with_quadratic

_NORMAL_95 = 1.959963984540054


_ORIGINS = {
    NOISE_PART: (
        "poses",
        "the scatter of the poses",
        "|a| - g at the poses and what is known of their noise beforehand",
        "record more poses, in different orientations",
    ),
    PRIOR_PART: (
        "priors",
        "what the poses leave open",
        "[priors]: the constants as far as the poses do not determine them",
        "record more poses, in different orientations, or learn [priors] (batch --learn-priors)",
    ),
    LEFT_OUT_PART: (
        "left_out_terms",
        "shift from the fit with all terms",
        "difference of the constants in the C from those with all terms and the priors as stated",
        "learn [priors] of this type of sensor (batch --learn-priors)",
    ),
}
"""Key, name, origin and advice of each part."""


def recording_sources(p: Curves, recording: RecordingFit) -> list[Source]:
    """All sources but the device's own; the covariance of an update has gravity in it."""
    return [
        *_fit(p, recording),
        *rate_source(p, recording),
        *([] if p.calibration.update else [_gravity(p)]),
        *thermometer(p),
        _unmodelled(p, recording),
        *([_temperature()] if recording.poses.temps_degc is None else []),
    ]


def _fit(p: Curves, recording: RecordingFit) -> list[Source]:
    """The covariance of the fit, part by part where it has priors."""
    if recording.parts:
        return [_part(p, recording, part) for part in recording.parts]
    key, name, _, advice = _ORIGINS[NOISE_PART]
    origin = "|a| - g at the poses, per degree of freedom"
    if p.calibration.update:
        name, origin = "the update", p.calibration.covariance_source
    if not recording.checked:
        unknown = "unknown: as many constants as poses"
        return [Source(key=key, name=name, unit="g", advice=advice, origin=unknown)]
    constants, force = _effects(p, CovariancePart(key, recording.covariance, recording.terms))
    return [
        Source(
            key=key,
            name=name,
            unit="g",
            advice=advice,
            origin=origin,
            sd=recording.rms_free_g,
            distribution=STUDENT,
            dof=float(recording.dof),
            constants=constants,
            force=force,
        )
    ]


def _part(p: Curves, recording: RecordingFit, part: CovariancePart) -> Source:
    key, name, origin, advice = _ORIGINS[part.key]
    constants, force = _effects(p, part)
    effect = float(force_variance(force, DIRECTIONS)[..., :3].max())
    sd, distribution = math.sqrt(max(effect, 0.0)), NORMAL
    if part.key == LEFT_OUT_PART:
        distribution = "known, not corrected"
    if part.key == NOISE_PART:
        # 1.96 of it is half the 95 % interval of a noise that is itself uncertain: as a Student's
        # part of few degrees of freedom, beside others, Welch and Satterthwaite make it too small.
        sd, distribution = recording.noise_95_g / _NORMAL_95, f"{STUDENT}, 95 % interval"
    return Source(
        key=key,
        name=name,
        unit="g",
        advice=advice,
        origin=origin,
        sd=sd,
        distribution=distribution,
        constants=constants,
        force=force,
        offset=part.key == LEFT_OUT_PART,
    )


def _effects(p: Curves, part: CovariancePart) -> tuple[FloatArray, FloatArray]:
    """Covariances of [K U0] and of D."""
    basis = p.calibration.shape.basis(p.temps_degc)
    covariance = np.einsum("np,apbq,nq->nab", basis, part.covariance, basis, optimize=True)
    order = np.argsort(ROWS)
    constants = covariance[:, order][:, :, order]
    return constants, with_quadratic(p, part.terms, mapped(-p.inverse, constants))


def _gravity(p: Curves) -> Source:
    """Local gravity: scales K."""
    rows = p.rows.copy()
    rows[:, :, 3] = 0.0
    return gravity(p, rows.reshape(-1, 12, 1))


def _unmodelled(p: Curves, recording: RecordingFit) -> Source:
    """Error of the model at held-out poses, beyond the scatter of the fitted ones."""
    held_out = recording.held_out_g
    if held_out is None:
        return Source(
            key="model",
            name="the model",
            unit="g",
            advice="record more poses",
            origin="unknown: no pose can be held out",
        )
    expected = recording.rms_free_g if recording.expected_g is None else recording.expected_g
    sd = math.sqrt(max(held_out**2 - expected**2, 0.0))
    return Source(
        key="model",
        name="the model",
        sd=sd,
        unit="g",
        distribution=STUDENT,
        dof=float(len(recording.residual_g)),
        origin="held-out |a| - g beyond what the fit expects of it",
        advice="record more poses, in different orientations",
        force=direct(p, np.broadcast_to(np.eye(3) * sd, (len(p.temps_degc), 3, 3))),
    )


def _temperature() -> Source:
    """The change with temperature is unknown: no temperature was recorded."""
    return Source(
        key="temperature",
        name="the change with temperature",
        unit="g",
        advice="record the temperature, and poses at several",
        origin="unknown: the recording has no temperature",
    )
