"""What is wrong with a recording of poses that is refused, or that passes with a doubt."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.causes import DOUBT, is_certain_fault
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription

if TYPE_CHECKING:
    from triaxcal.diagnosis.answer import Diagnosis


_FAR_SDS = 3.0
"""Of the mean scale factor in [priors]."""


def causes_of_poses(unit: UnitDescription, calibration: Calibration) -> Diagnosis | None:
    """Ranked causes of what the poses of a recording contradict; None where angles are known."""
    layout, recording = unit.recording, calibration.recording
    if layout is None or recording is None or layout.angles is not None:
        return None
    # Only recordings that are refused or doubtful wait for it.
    from triaxcal.diagnosis.poses.answer import diagnose_poses  # noqa: PLC0415

    try:
        return diagnose_poses(unit, layout, recording.poses)
    except (RefusedError, np.linalg.LinAlgError):
        return None


def with_pose_cause(
    refusal: RefusedError, unit: UnitDescription, calibration: Calibration
) -> RefusedError:
    """The refusal, with the cause that explains the poses best.

    It takes the place of general advice where the odds against a sound unit are clear, and it is no
    symptom.
    """
    found = causes_of_poses(unit, calibration)
    recording = calibration.recording
    if found is None or recording is None or not found.answer:
        return refusal
    if found.answer[0].symptom or not found.clear:
        remedy = f"{refusal.remedy}; {found.sentence}"
        return RefusedError(refusal.place, refusal.found, expected=refusal.expected, remedy=remedy)
    return _refused(refusal, found, recording.poses)


def refuse_certain_fault_of_poses(unit: UnitDescription, calibration: Calibration) -> None:
    """Refuse poses within the limits that a fault explains beyond doubt; as of a tilter.

    Constants of few poses follow a fault. The causes are ranked where an error, of a pose held out
    too, is beyond half its limit.

    Raises
    ------
    RefusedError
        Where `delivery.causes.is_certain_fault` of the larger limit.
    """
    if not doubtful_poses(unit, calibration):
        return
    found, recording = causes_of_poses(unit, calibration), calibration.recording
    if found is None or recording is None:
        return
    if not is_certain_fault(found, max(unit.limits.at_t0_g, unit.limits.over_range_g)):
        return
    refusal = RefusedError(
        recording.poses.source,
        "residuals and held-out errors are within the limits nevertheless",
        expected="poses of which no fault is more probable than a sound unit",
    )
    raise _refused(refusal, found, recording.poses)


def doubtful_poses(unit: UnitDescription, calibration: Calibration) -> bool:
    """Whether an error at a pose, held out too, is beyond half its limit, or 1 g reads far off."""
    recording = calibration.recording
    if recording is None or unit.recording is None:
        return False
    nominal = unit.recording.reading_of_1_g
    if nominal is not None:
        length = float(np.median(np.linalg.norm(recording.poses.readings, axis=1)))
        if abs(length / nominal - 1.0) > _FAR_SDS * unit.priors.mean_scale:
            return True
    temps = [unit.t0_degc if p.temp_degc is None else p.temp_degc for p in recording.poses.poses]
    limits = DOUBT * np.array([unit.limits.at(t, unit.t0_degc)[0] for t in temps])
    held_out = any(
        (np.abs(h.error_g) > limits[list(h.poses)]).any() for h in recording.held_out if h.poses
    )
    return bool((np.abs(recording.residual_g) > limits).any()) or held_out


def _refused(refusal: RefusedError, found: Diagnosis, poses: PoseSet) -> RefusedError:
    """The refusal with the cause; at the poses to blame, where they are few."""
    lines = found.answer[0].rows
    if len(found.answer) > 1 or not 0 < len(lines) < len(poses.poses) / 2:
        return RefusedError(
            refusal.place, refusal.found, expected=refusal.expected, remedy=found.sentence
        )
    where = refusal.place.removeprefix(poses.source).lstrip(", ")
    shown = f"it shows at {where}: {refusal.found}" if where else refusal.found
    plural = "s" * (len(lines) > 1)
    return RefusedError(
        f"{poses.source}, line{plural} {', '.join(map(str, sorted(lines)))}",
        f"{found.sentence}; {shown}",
        expected=refusal.expected,
        remedy="check these poses with `triaxcal poses`, remove them or record them again",
    )
