"""A delivered calibration brought up to date by poses from the field, and what that changed.

The prior is `uncertainty.fieldprior`'s. Poses that contradict it are refused: where

    r^T S^-1 r / n,    S = H (V + drift) H^T + R,

is larger than a sound unit gives once in 1 / CHANCE updates, the poses and the calibration cannot
both be right, and an average of both would be wrong for certain. R holds what is new in the poses:
their noise, and local gravity, which acts again.

An update must tell more than what it replaces. Where a drift is stated, or the poses show one, that
is the calibration with the drift allowed for. Otherwise it is the calibration as it was delivered.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.fieldupdate import Update
from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.field.poses import FieldPoses, inside_range
from triaxcal.fitting.field.update import Drift, State, innovation, updated
from triaxcal.model.framefree import frame_free, frame_free_slopes
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.expected import Expectation, Expected, chance_of, expectation
from triaxcal.uncertainty.explain import Parts, why
from triaxcal.uncertainty.fieldprior import field_prior, noise_of_poses
from triaxcal.uncertainty.updated import FieldUpdate, K, Solved, updated_calibration

_USEFUL = 0.9
"""Of the uncertainty of |a|: an update must lower it below this share."""


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
    order : int
        Of the functions that the device has.
    """

    parents: tuple[str, ...]
    recording: str
    recording_sha256: str
    earlier_sha256: tuple[str, ...] = ()
    order: int = 0


def update_by_poses(
    parts: Parts,
    poses: FieldPoses,
    gravity_g: float,
    drift: Drift,
    source: Source,
    *,
    drift_is_stated: bool = True,
) -> FieldUpdate:
    """Bring a calibration up to date.

    Parameters
    ----------
    drift_is_stated : bool
        Whether somebody knows of the drift; if not, poses that agree with the calibration must
        lower its own uncertainty.

    Raises
    ------
    RefusedError
        When no pose is within the range, the poses contradict the calibration, or they tell no
        more than it does.
    """
    poses = inside_range(poses, parts[2].range_degc)
    expects = expectation(*parts, poses.temps_degc)
    new, prior = expects.at(poses, gravity_g), field_prior(parts, drift)
    noise = noise_of_poses(parts[0], expects, poses, new)
    known = prior.state, prior.allowed, poses, noise, gravity_g
    posterior = updated(*known)
    found = innovation(*known, theta=posterior.theta)
    solved = Solved(poses, gravity_g, new, prior, posterior, found)
    if chance_of(found.chi_square, len(poses), new.dof) < CHANCE:
        raise _contradiction(expects, solved, drift)
    made = _changes(parts, solved)
    drifted = drift_is_stated or chance_of(new.chi_square, len(poses), new.dof) < CHANCE
    _refuse_nothing(made, new, drifted=drifted)
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
        source.order,
    )
    calibration = replace(updated_calibration(made, solved), update=record)
    return replace(made, calibration=calibration)


def _changes(parts: Parts, solved: Solved) -> FieldUpdate:
    """What the update changes; its calibration is still the one before."""
    unit, _, calibration = parts
    poses, prior, theta = solved.poses, solved.prior, solved.posterior.theta
    state, t0 = prior.state, unit.t0_degc
    t0_basis, nine = calibration.shape.basis(t0), _nine(state)
    each = prior.factory + prior.thermal, prior.allowed + prior.thermal, solved.covariance
    sds = [_sd(nine, covariance) for covariance in each]
    lengths = [prior.length_g(covariance, t0) for covariance in each]
    now, _ = state.length(state.delivered(theta), poses.readings, poses.temps_degc)
    return FieldUpdate(
        calibration=calibration,
        poses=poses,
        before=frame_free(state.curves(state.theta) @ t0_basis),
        after=frame_free(state.curves(theta) @ t0_basis),
        sd_before=sds[0],
        sd_allowed=sds[1],
        sd_after=sds[2],
        length_before_g=lengths[0],
        length_allowed_g=lengths[1],
        length_after_g=lengths[2],
        share=solved.posterior.share_of_data(nine),
        chi_square=solved.innovation.chi_square,
        error_before_g=solved.new.error_g,
        error_after_g=now - solved.gravity_g,
    )


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


def _contradiction(expects: Expectation, solved: Solved, drift: Drift) -> RefusedError:
    """The refusal, with what would explain the poses."""
    poses, found = solved.poses, solved.innovation
    explanations, suspicions = why(expects, poses, solved.gravity_g, solved.new)
    words = suspicions[0] if suspicions else "nothing explains it"
    if explanations:
        others = len(explanations) - 1
        words = f"they agree if {explanations[0].words}"
        words += f", or by {others} other single changes" * bool(others)
    return RefusedError(
        poses.source,
        f"its poses contradict the delivered calibration beyond its uncertainty and the drift: "
        f"chi-square {found.chi_square:.4g} of {len(poses)} poses; {words}",
        expected=f"about {len(poses)}, with a drift of {drift.bias_g * 1e3:.3g} mg of the biases "
        f"and {drift.scale * 1e6:.3g} ppm of the scales (standard deviations)",
        remedy="look at `triaxcal check`; state a larger drift if the sensor may have it, or "
        "calibrate the unit again",
    )


def _refuse_nothing(made: FieldUpdate, new: Expected, *, drifted: bool) -> None:
    """Refuse an update that makes |a| no more certain than what it would replace."""
    least_g = _USEFUL * (made.length_allowed_g if drifted else made.length_before_g)
    if made.length_after_g <= least_g:
        return
    count, now = len(made.poses), f"+-{K * made.length_after_g * 1e3:.3g} mg after the update"
    poses = f"{count} pose" + "s" * (count != 1)
    if drifted:
        noise = float(np.median(new.own_sd_g)) * 1e3
        raise RefusedError(
            made.poses.source,
            f"{poses} tell too little: |a| is uncertain by "
            f"+-{K * made.length_allowed_g * 1e3:.3g} mg with the drift, and by {now}; "
            f"the noise of a pose is {noise:.3g} mg",
            expected="poses that tell more than the calibration and its drift",
            remedy="hold the unit stiller and longer, in more directions; the delivered "
            "calibration is kept",
        )
    raise RefusedError(
        made.poses.source,
        f"{poses} in agreement with the delivered calibration, which knows more: |a| is uncertain "
        f"by +-{K * made.length_before_g * 1e3:.3g} mg, and would be by {now}",
        expected="poses that show a drift, or tell more than the calibration",
        remedy="keep the delivered calibration; state the drift if you know that there is one",
    )
