"""`Calibration.check`: a delivered calibration against a recording that was not used for it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted, columns_of
from triaxcal.delivery.inputs import files_sha256
from triaxcal.delivery.order import choose_functions
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from triaxcal.api.study import Study
    from triaxcal.fitting.field.poses import FieldPoses
    from triaxcal.uncertainty.check import FieldCheck
    from triaxcal.uncertainty.updated import FieldUpdate


_DRIFT_BY_LIMITS = None, None, None


class InTheField:
    """What can be done with a calibration and a recording that was made with it."""

    @property
    def fitted(self) -> Fitted:
        """The fit behind it."""
        raise NotImplementedError

    def check(
        self,
        recorded: Any,
        *,
        layout: str | Path | None = None,
        gravity_m_per_s2: float | None = None,
    ) -> Study[FieldCheck]:
        """Hold the calibration against a recording that was not used for it.

        Parameters
        ----------
        recorded : path; or a mapping, data frame or structured array of columns
            In the layout of the unit's [recording]; of a unit without one, as measurements.csv.
        layout : path or None
            TOML file whose table [recording] says what the columns are, in place of the unit's.
        gravity_m_per_s2 : float or None
            Local gravity where it was recorded; None is that of the unit.

        Returns
        -------
        Study
            Its `result` has `passed`, the poses, chi-square and the reasons.

        Raises
        ------
        RefusedError
            When the recording cannot be read, has no pose within the range or belongs to another
            serial number, or the calibration does not know its uncertainty.
        """
        from triaxcal.api.study import Study  # noqa: PLC0415
        from triaxcal.delivery.check import in_the_c  # noqa: PLC0415
        from triaxcal.fitting.field.poses import inside_range  # noqa: PLC0415
        from triaxcal.report.check import check_text  # noqa: PLC0415
        from triaxcal.uncertainty.check import check_poses  # noqa: PLC0415

        done = self.fitted
        gravity_g = stated_gravity_g(done, gravity_m_per_s2)
        poses = inside_range(poses_of(done, recorded, layout), done.calibration.range_degc)
        _refuse_used(done, poses, recorded)
        by_c = in_the_c(done, poses.readings, poses.temps_degc)
        parts = done.unit, done.measurements, done.calibration
        found = check_poses(parts, poses, gravity_g, by_c.force_g, by_c.status)
        return Study(found, check_text(done.unit.serial, found))

    def update(
        self,
        recorded: Any,
        *,
        layout: str | Path | None = None,
        gravity_m_per_s2: float | None = None,
        bias_drift_mg: float | None = None,
        scale_drift_ppm: float | None = None,
        axes_drift_micro_rad: float | None = None,
    ) -> Study[FieldUpdate]:
        """Bring the calibration up to date by one still pose or more; nothing is written.

        `triaxcal.update` also makes and proves the C.

        Parameters
        ----------
        recorded, layout, gravity_m_per_s2
            As `check`.
        bias_drift_mg, scale_drift_ppm, axes_drift_micro_rad : float or None
            Standard deviations of the drift that is allowed for; None follows from the limits.

        Returns
        -------
        Study
            Its `result` has the new constants and what changed.

        Raises
        ------
        RefusedError
            As `check`; when the poses contradict the calibration, or lower no uncertainty.
        """
        from triaxcal.api.study import Study  # noqa: PLC0415
        from triaxcal.report.update import update_text  # noqa: PLC0415

        done, drift = self.fitted, (bias_drift_mg, scale_drift_ppm, axes_drift_micro_rad)
        made = bring_up_to_date(done, recorded, layout, gravity_m_per_s2, drift)
        return Study(made.found, update_text(done.unit.serial, made.found, done.calibration))


@dataclass(frozen=True)
class Updated:
    """A calibration brought up to date, not yet delivered.

    Attributes
    ----------
    before, fitted : Fitted
    found : FieldUpdate
        What changed.
    """

    before: Fitted
    fitted: Fitted
    found: FieldUpdate


def bring_up_to_date(
    done: Fitted,
    recorded: Any,
    layout: str | Path | None = None,
    gravity_m_per_s2: float | None = None,
    drift: tuple[float | None, float | None, float | None] = _DRIFT_BY_LIMITS,
) -> Updated:
    """Update of a calibration by a recording; `drift` is mg, ppm, micro-rad, None by the limits."""
    from triaxcal.fitting.field.update import Drift, default_drift  # noqa: PLC0415
    from triaxcal.fitting.recorded.calibrate import pose_dwells  # noqa: PLC0415
    from triaxcal.uncertainty.update import Source, update_by_poses  # noqa: PLC0415

    gravity_g = stated_gravity_g(done, gravity_m_per_s2)
    usual = default_drift(done.unit.limits)
    sizes = zip(drift, (1e-3, 1e-6, 1e-6), (usual.bias_g, usual.scale, usual.axes_rad), strict=True)
    names = ("bias_drift_mg", "scale_drift_ppm", "axes_drift_micro_rad")
    allowed = Drift(*(
        own if v is None else _positive(name, v) * to_si
        for name, (v, to_si, own) in zip(names, sizes, strict=True)
    ))  # fmt: skip
    poses = poses_of(done, recorded, layout)
    digest = _digest(recorded)
    _refuse_used(done, poses, recorded)
    before = done.calibration.update
    earlier = () if before is None else before.parents
    logs = () if before is None else (*before.earlier_sha256, before.recording_sha256)
    parts = done.unit, done.measurements, done.calibration
    order = choose_functions(*parts).plan.shape.order
    parents = (*earlier, done.inputs_sha256)
    source = Source(parents, Path(poses.source).name, digest, logs, order)
    found = update_by_poses(
        parts, poses, gravity_g, allowed, source, drift_is_stated=drift != _DRIFT_BY_LIMITS
    )
    stated = f"{done.inputs_sha256} {digest} {gravity_g!r} {allowed!r}"
    inputs = hashlib.sha256(stated.encode()).hexdigest()
    kept = found.poses
    dwells = pose_dwells(kept.poses, kept.temps_degc)
    measurements = MeasurementSet(kept.source, dwells)
    return Updated(done, Fitted(done.unit, measurements, inputs, found.calibration), found)


def _refuse_used(done: Fitted, poses: FieldPoses, recorded: Any) -> None:
    """Refuse poses that the calibration was made of, or updated by: they tell nothing new."""
    from triaxcal.fitting.field.poses import known_poses  # noqa: PLC0415

    update, used = done.calibration.update, ""
    logs = () if update is None else (update.recording_sha256, *update.earlier_sha256)
    same = known_poses(poses, done.measurements)
    if logs and _digest(recorded) in logs:
        used = "the calibration was updated by this recording already"
    elif 2 * same >= len(poses):
        used = f"{same} of {len(poses)} poses are those that the calibration was made of"
    if used:
        raise RefusedError(
            poses.source,
            used,
            expected="poses that the calibration has not seen",
            remedy="record new poses",
        )


def _positive(name: str, value: float) -> float:
    number = float(finite(name, value))
    if not 0.0 < number <= 1e6:
        raise RefusedError(name, f"found {number:g}", expected="a number above 0")
    return number


def _digest(recorded: Any) -> str:
    if isinstance(recorded, str | Path):
        return files_sha256((Path(recorded),), "name the recording")
    digest = hashlib.sha256()
    for name, values in sorted(columns_of(recorded).items()):
        digest.update(f"{name} {hashlib.sha256(np.asarray(values).tobytes()).digest()!r}".encode())
    return digest.hexdigest()


def poses_of(done: Fitted, recorded: Any, layout: str | Path | None) -> FieldPoses:
    """Poses of a recording in the field."""
    from triaxcal.fitting.field.poses import field_poses  # noqa: PLC0415
    from triaxcal.unit.recording import read_layout  # noqa: PLC0415

    stated = None if layout is None else read_layout(Path(layout))
    given = Path(recorded) if isinstance(recorded, str | Path) else columns_of(recorded)
    return field_poses(done.unit, done.calibration, given, stated)


def stated_gravity_g(done: Fitted, gravity_m_per_s2: float | None) -> float:
    """Local gravity in g of 9.80665 m/s^2."""
    if gravity_m_per_s2 is None:
        return done.unit.gravity_g
    value = float(finite("gravity_m_per_s2", gravity_m_per_s2))
    if not 9.7 <= value <= 9.9:
        raise RefusedError(
            "gravity_m_per_s2", f"found {value:g}", expected="9.7 to 9.9 m/s^2, as on earth"
        )
    return value / STANDARD_GRAVITY_M_PER_S2
