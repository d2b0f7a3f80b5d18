"""`Calibration.check`: a delivered calibration against a recording that was not used for it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted, columns_of
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from triaxcal.api.studies import Study
    from triaxcal.fitting.field.poses import FieldPoses
    from triaxcal.uncertainty.check import FieldCheck


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
        from triaxcal.api.studies import Study  # noqa: PLC0415
        from triaxcal.delivery.check import integer_force_g  # noqa: PLC0415
        from triaxcal.fitting.field.poses import inside_range  # noqa: PLC0415
        from triaxcal.report.check import check_text  # noqa: PLC0415
        from triaxcal.uncertainty.check import check_poses  # noqa: PLC0415

        done = self.fitted
        gravity_g = stated_gravity_g(done, gravity_m_per_s2)
        poses = inside_range(poses_of(done, recorded, layout), done.calibration.range_degc)
        force = integer_force_g(done, poses.readings, poses.temps_degc)
        c_error_g = (force**2).sum(axis=1) ** 0.5 - gravity_g
        parts = done.unit, done.measurements, done.calibration
        found = check_poses(parts, poses, gravity_g, c_error_g)
        return Study(found, check_text(done.unit.serial, found))


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
