"""The calibration that an update gives: the curves, and the poses from the field behind them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration, CalibrationPoint, Candidate
from triaxcal.fitting.core.judged import ORIENTATION, HeldOutPoses
from triaxcal.fitting.core.posterior import Posterior
from triaxcal.fitting.core.recorded import RecordingFit, TermsCovariance
from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.fitting.field.update import Innovation
from triaxcal.fitting.recorded.made import covariance_blocks
from triaxcal.model.framefree import NAMES
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.expected import Expected
from triaxcal.uncertainty.fieldprior import FieldPrior

K = 2.0
"""Standard uncertainties that are stated after +-: 95 %."""
_UNSEEN = 0.1
"""Share of the data below which a constant counts as not seen by the poses."""


@dataclass(frozen=True)
class FieldUpdate:
    """An update, and what it changed.

    Attributes
    ----------
    calibration : Calibration
    poses : FieldPoses
        Those within the working range.
    before, after : arrays, shape (9,)
        Nine constants at T0 that no rotation of the frame changes (`model.framefree`).
    sd_before, sd_allowed, sd_after : arrays, shape (9,)
        Their standard uncertainties: of the calibration, with the allowance for drift, and now.
    length_before_g, length_allowed_g, length_after_g : float
        The same of |a| at T0, rms over all orientations.
    share : array, shape (9,)
        How much of each the poses determine now, 0 to 1.
    chi_square : float
        Of the poses against the calibration and its drift.
    error_before_g, error_after_g : arrays, shape (n,)
        |a| - g at the poses.
    """

    calibration: Calibration
    poses: FieldPoses
    before: FloatArray
    after: FloatArray
    sd_before: FloatArray
    sd_allowed: FloatArray
    sd_after: FloatArray
    length_before_g: float
    length_allowed_g: float
    length_after_g: float
    share: FloatArray
    chi_square: float
    error_before_g: FloatArray
    error_after_g: FloatArray

    @property
    def unseen(self) -> tuple[str, ...]:
        """Constants of which the poses say next to nothing."""
        return tuple(n for n, s in zip(NAMES, self.share, strict=True) if s < _UNSEEN)


@dataclass(frozen=True)
class Solved:
    """Poses, what was expected of them, and the most probable parameters.

    Attributes
    ----------
    poses : FieldPoses
    gravity_g : float
    new : Expected
        By the calibration before, without a drift.
    prior : FieldPrior
    posterior : Posterior
    innovation : Innovation
    """

    poses: FieldPoses
    gravity_g: float
    new: Expected
    prior: FieldPrior
    posterior: Posterior
    innovation: Innovation

    @property
    def covariance(self) -> FloatArray:
        """Of theta after the update, (p, p)."""
        return self.posterior.spread_covariance + self.prior.thermal


def updated_calibration(made: FieldUpdate, solved: Solved) -> Calibration:
    """The calibration after the update; its poses are those of the field."""
    state, theta, covariance = solved.prior.state, solved.posterior.theta, solved.covariance
    old, P = made.calibration, state.functions
    constants = state.curves(theta)
    Q = None if old.terms.quadratic_per_g is None else state.quadratic(theta)
    full = covariance[: 12 * P, : 12 * P].reshape(12, P, 12, P)
    thermal, t0 = old.shape.model(constants), old.thermal.t0_degc
    basis = old.shape.basis(t0)
    at_t0 = np.einsum("p,apbq,q->ab", basis, full, basis)
    recording = _recording(made, solved)
    recording = replace(recording, covariance=full, terms=_terms(old, covariance, 12 * P))
    rms = recording.rms_g
    return replace(
        old,
        thermal=thermal,
        terms=replace(old.terms, quadratic_per_g=Q),
        points=(CalibrationPoint(t0, thermal.constants_at(t0), at_t0, rms, rms),),
        parameter_covariance=covariance_blocks(full),
        selection_reason=_before(old.selection_reason),
        covariance_source=f"the calibration before, drift, and {len(made.poses)} poses of |a| = g",
        candidates=(_candidate(old, recording),),
        check_dwells=(),
        recording=recording,
        notes=(),
        held_out=None,
        runs=None,
    )


def _candidate(old: Calibration, recording: RecordingFit) -> Candidate:
    """The update as the only row of the table of candidates."""
    return Candidate(
        estimator=old.estimator,
        shape=old.shape,
        parameters=old.shape.parameters,
        held_out_g=recording.left_out_length_g,
        fit_residual_g=recording.rms_g,
        chosen=True,
        label=f"update; {old.shape.label}",
        short_label="update by poses",
        condition=recording.condition,
    )


def _before(reason: str) -> str:
    mark = "of the calibration before the update: "
    return mark + reason.removeprefix(mark)


def _terms(old: Calibration, covariance: FloatArray, count: int) -> TermsCovariance:
    """Covariance of Q after the update; that of a term in dT/dt stays."""
    before = TermsCovariance() if old.recording is None else old.recording.terms
    if len(covariance) == count:
        return before
    P = count // 12
    cross = covariance[:count, count:].reshape(12, P, 18)
    return replace(before, quadratic=covariance[count:, count:], cross=cross)


def _recording(made: FieldUpdate, solved: Solved) -> RecordingFit:
    state, singular = solved.prior.state, solved.posterior.at.singular
    held_out, expected = solved.innovation.left_out
    findings = [*made.poses.findings]
    if made.unseen:
        findings.append(
            f"the update says next to nothing of {', '.join(made.unseen)}: their values "
            "stay as they were, their uncertainty grows by the drift"
        )
    findings.append("|a| shows no rotation of the axes against the case: it stays as it was")
    size = len(state.theta)
    low = float(singular.min(initial=0.0)) if len(singular) >= size else 0.0
    high = float(singular.max(initial=0.0))
    return RecordingFit(
        poses=made.poses.poses,
        route="update of the calibration before by |a| = g",
        covariance=np.zeros((12, state.functions, 12, state.functions)),
        dof=min(solved.new.dof, 10**6) + len(made.poses),
        rms_g=float(np.sqrt(np.mean(made.error_after_g**2))),
        rms_free_g=float(np.sqrt(np.mean(solved.new.own_sd_g**2))),
        held_out_g=float(np.sqrt(np.mean(held_out**2))),
        left_out_length_g=float(np.sqrt(np.mean(held_out**2))),
        condition=math.sqrt((1.0 + high**2) / (1.0 + low**2)),
        weakest=", ".join(made.unseen),
        residual_g=made.error_after_g,
        findings=tuple(findings),
        expected_g=float(np.sqrt(np.mean(expected**2))),
        held_out_poses=len(made.poses),
        held_out=(HeldOutPoses(ORIENTATION, tuple(range(len(held_out))), held_out),),
    )
