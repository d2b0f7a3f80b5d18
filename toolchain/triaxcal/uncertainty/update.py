"""A delivered calibration brought up to date by poses from the field, and what that changed.

The prior is the covariance of the calibration's fit, the sources of `_ALIKE` at the temperature
where each is largest, and an allowance for drift. Gravity acts again, in the poses. Poses that
contradict it are refused: where

    r^T S^-1 r / n,    S = H (V + drift) H^T + R,

is larger than a sound unit gives once in 1 / CHANCE updates, the poses and the calibration cannot
both be right, and an average of both would be wrong for certain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.fieldupdate import Update
from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.field.poses import FieldPoses, inside_range
from triaxcal.fitting.field.update import (
    Drift,
    Innovation,
    State,
    calibration_covariance,
    drift_covariance,
    innovation,
    state_of,
    updated,
)
from triaxcal.model.framefree import frame_free, frame_free_slopes
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.expected import chance_of, expectation
from triaxcal.uncertainty.explain import Parts
from triaxcal.uncertainty.propagation import ROWS
from triaxcal.uncertainty.rig_sources import GRAVITY_M_PER_S2
from triaxcal.uncertainty.updated import FieldUpdate, updated_calibration
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_ALIKE = frozenset({"repeatability", "squareness", "level", "thermal_model", "runs"})
"""Sources of a tilter's calibration that are in the prior besides the noise of its readings."""
_NOTHING = 0.02


@dataclass(frozen=True)
class Source:
    """Where an update comes from, for its record.

    Attributes
    ----------
    parents : tuple of str
        inputs_sha256 of the calibrations before it, the oldest first.
    recording, recording_sha256 : str
    earlier_sha256 : tuple of str
        Of the recordings of the updates before.
    """

    parents: tuple[str, ...]
    recording: str
    recording_sha256: str
    earlier_sha256: tuple[str, ...] = ()


def update_by_poses(
    parts: Parts, poses: FieldPoses, gravity_g: float, drift: Drift, source: Source
) -> FieldUpdate:
    """Bring a calibration up to date.

    Raises
    ------
    RefusedError
        When no pose is within the range, the poses contradict the calibration, or they lower no
        uncertainty.
    """
    unit, _, calibration = parts
    poses = inside_range(poses, calibration.range_degc)
    new = expectation(*parts, poses.temps_degc).at(poses, gravity_g)
    stated = unit.stated.gravity_m_per_s2
    gravity_sd = (GRAVITY_M_PER_S2 if stated is None else stated) / STANDARD_GRAVITY_M_PER_S2
    noise = np.diag(new.own_sd_g**2) + gravity_sd**2
    state = state_of(calibration)
    factory = calibration_covariance(state, _alike(parts))
    allowed = factory + drift_covariance(state, drift)
    found = innovation(state, allowed, poses, noise, gravity_g)
    _refuse_contradiction(found, poses, new.dof, drift)
    posterior = updated(state, allowed, poses, noise, gravity_g)
    nine = _nine(state)
    share = posterior.share_of_data(nine)
    if share.max() < _NOTHING:
        raise RefusedError(
            poses.source,
            f"its {len(poses)} poses lower no uncertainty: their noise is "
            f"{float(np.median(new.own_sd_g)) * 1e3:.3g} mg",
            expected="poses that tell more than the calibration and its drift",
            remedy="hold the unit stiller and longer, or keep the calibration",
        )
    t0 = unit.t0_degc
    t0_basis = calibration.shape.basis(t0)
    after = frame_free(state.curves(posterior.theta) @ t0_basis)
    covariance = posterior.spread_covariance
    made = FieldUpdate(
        calibration=calibration,
        poses=poses,
        before=frame_free(state.curves(state.theta) @ t0_basis),
        after=after,
        sd_before=_sd(nine, factory),
        sd_allowed=_sd(nine, allowed),
        sd_after=_sd(nine, covariance),
        share=share,
        chi_square=found.chi_square,
        error_before_g=new.error_g,
        error_after_g=state.length(state.delivered(posterior.theta), poses)[0] - gravity_g,
    )
    record = Update(
        source.parents,
        source.recording,
        source.recording_sha256,
        len(poses),
        gravity_g,
        drift.bias_g,
        drift.scale,
        drift.axes_rad,
        found.chi_square,
        source.earlier_sha256,
    )
    calibrated = updated_calibration(made, (state, posterior), found, new.own_sd_g, new.dof)
    return replace(made, calibration=replace(calibrated, update=record))


def _alike(parts: Parts) -> FloatArray:
    """Covariance of the constants of a tilter's rig and model, (12, 12); zero for a recording.

    Of each source the largest over the range: the thermal model errs least at T0.
    """
    unit, measurements, calibration = parts
    total = np.zeros((12, 12))
    if calibration.recording is None:
        grid = np.unique([*np.linspace(*calibration.range_degc, 9), unit.t0_degc])
        rows = np.array(ROWS)
        for s in uncertainty(unit, measurements, calibration, None, grid).sources:
            if s.key in _ALIKE and s.constants is not None:
                worst = int(np.trace(s.constants, axis1=1, axis2=2).argmax())
                total += s.constants[worst][rows[:, None], rows]
    return total


def _nine(state: State) -> FloatArray:
    """Derivative of the nine constants at T0 by theta, (9, parameters)."""
    calibration = state.calibration
    t0 = calibration.thermal.t0_degc
    slopes = frame_free_slopes(calibration.thermal.constants_at(t0))
    columns = slopes[:, :, None] * calibration.shape.basis(t0)
    result = np.zeros((9, len(state.theta)))
    result[:, : 12 * state.functions] = columns.reshape(9, -1)
    return result


def _sd(nine: FloatArray, covariance: FloatArray) -> FloatArray:
    variance = np.einsum("kp,pq,kq->k", nine, covariance, nine)
    result: FloatArray = np.sqrt(np.maximum(variance, 0.0))
    return result


def _refuse_contradiction(found: Innovation, poses: FieldPoses, dof: int, drift: Drift) -> None:
    chance = chance_of(found.chi_square, len(poses), dof)
    if chance >= CHANCE:
        return
    error, sd = found.left_out
    worst = int(np.abs(error / sd).argmax())
    of_worst = (
        f"{poses.names[worst]} contradicts most: |a| - g = {found.error_g[worst] * 1e3:+.3g} mg, "
        f"{error[worst] * 1e3:+.3g} mg from what the others predict, whose sd is "
        f"{sd[worst] * 1e3:.2g} mg"
    )
    raise RefusedError(
        poses.source,
        f"its poses contradict the delivered calibration beyond its uncertainty: chi-square "
        f"{found.chi_square:.4g} of {len(poses)} poses; {of_worst}",
        expected=f"about {len(poses)}, with a drift of {drift.bias_g * 1e3:.3g} mg of the biases "
        f"and {drift.scale * 1e6:.3g} ppm of the scales (standard deviations)",
        remedy="look at `triaxcal check`; state a larger drift if the sensor may have it, or "
        "calibrate the unit again",
    )
