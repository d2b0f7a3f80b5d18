"""Sources of a calibration from a recording: the poses' scatter, gravity, thermometer, held out."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.fitting.core.recorded import RecordingFit
from triaxcal.uncertainty.propagation import ROWS, Curves, mapped
from triaxcal.uncertainty.rig_sources import gravity, thermometer
from triaxcal.uncertainty.source import STUDENT, Source, direct
from triaxcal.uncertainty.terms_sources import rate_source, with_quadratic


def recording_sources(p: Curves, recording: RecordingFit) -> list[Source]:
    """All sources but the device's own."""
    return [
        _poses(p, recording),
        *rate_source(p, recording),
        _gravity(p),
        *thermometer(p),
        _unmodelled(p, recording),
        *([_temperature()] if recording.poses.temps_degc is None else []),
    ]


def _poses(p: Curves, recording: RecordingFit) -> Source:
    """Scatter of the poses: the covariance of the fit."""
    if not recording.checked:
        return Source(
            key="poses",
            name="the scatter of the poses",
            unit="g",
            advice="record more poses, in other orientations",
            origin="unknown: as many constants as poses",
        )
    covariance = p.calibration.constants_covariance(p.temps_degc)
    order = np.empty(12, dtype=np.int64)
    order[list(ROWS)] = np.arange(12)
    constants = covariance[:, order][:, :, order]
    return Source(
        key="poses",
        name="the scatter of the poses",
        sd=recording.rms_free_g,
        unit="g",
        distribution=STUDENT,
        dof=float(recording.dof),
        origin="|a| - g at the poses, per degree of freedom",
        advice="record more poses, in different orientations",
        constants=constants,
        force=with_quadratic(p, recording, mapped(-p.inverse, constants)),
    )


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
    sd = math.sqrt(max(held_out**2 - recording.rms_free_g**2, 0.0))
    return Source(
        key="model",
        name="the model",
        sd=sd,
        unit="g",
        distribution=STUDENT,
        dof=float(len(recording.residual_g)),
        origin="held-out |a| - g beyond the scatter of the poses",
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
