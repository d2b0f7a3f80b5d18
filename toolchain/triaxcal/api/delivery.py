"""`deliver`: what `make calib-header` does, from a unit's folder to files that are proven."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.codegen.compiler import Compilation, reference_under_way

if TYPE_CHECKING:
    from triaxcal.api.calibration import Calibration
    from triaxcal.api.imu import ImuCalibration


@dataclass(frozen=True)
class Delivered:
    """Files that passed every check, in place.

    Attributes
    ----------
    folder : Path
        Where they are: a folder of the unit's name.
    files : tuple of str
        Their names.
    calibration : Calibration or ImuCalibration
    summary : str
        The text that the command line prints.
    warnings : tuple of str
        Contradictions with earlier calibrations of the unit.
    """

    folder: Path
    files: tuple[str, ...]
    calibration: Calibration | ImuCalibration
    summary: str
    warnings: tuple[str, ...] = ()


def deliver(
    folder: str | Path, build: str | Path = "build", progress: Progress | None = None
) -> Delivered:
    """Calibrate a unit or an IMU, make its C, prove it, check it bit for bit, and write the files.

    Parameters
    ----------
    folder : path
        Of the unit: unit.toml and its readings.
    build : path
        The files go into a folder of the unit's name below it: all of them, or none.
    progress : callable, or None
        For an IMU, whose filter takes minutes.

    Raises
    ------
    RefusedError
        When the data or the result is refused; nothing is written then.
    """
    unit = Path(folder)
    with reference_under_way() as reference:  # gcc works while numpy is imported
        from triaxcal.base.tomltable import has_table  # noqa: PLC0415
        from triaxcal.unit.folder import find_unit  # noqa: PLC0415

        if not has_table(find_unit(unit), "dynamic"):
            return _deliver_unit(unit, Path(build), reference)
    return _deliver_imu(unit, Path(build), progress)


def _deliver_unit(unit: Path, build: Path, reference: Compilation) -> Delivered:
    from triaxcal.api.calibration import Calibration  # noqa: PLC0415
    from triaxcal.api.unit import Unit  # noqa: PLC0415
    from triaxcal.base.publish import publish  # noqa: PLC0415
    from triaxcal.delivery.saved import Saved  # noqa: PLC0415
    from triaxcal.delivery.unit import deliver as made_of  # noqa: PLC0415
    from triaxcal.report.files import SOMETIMES, all_files  # noqa: PLC0415
    from triaxcal.report.passport.content import passport  # noqa: PLC0415
    from triaxcal.report.summary import summary  # noqa: PLC0415

    try:
        delivery = made_of(unit, reference)
    except RefusedError as refusal:
        raise _beside_earlier(refusal, build / unit.absolute().name) from refusal
    warnings: tuple[str, ...] = ()
    if (unit / "history").is_dir():
        from triaxcal.report.history import contradiction_of  # noqa: PLC0415

        warnings = contradiction_of(unit, delivery)
    made = passport(delivery, {})
    files = all_files(delivery, made)
    target = build / delivery.unit.name
    publish(files, target, SOMETIMES)
    calibration = Calibration(Unit.of(delivery.unit, unit), Saved.of(delivery))
    text = summary(made, files, str(target))
    return Delivered(target, tuple(files), calibration, text, warnings)


def _beside_earlier(refusal: RefusedError, folder: Path) -> RefusedError:
    """The refusal; where an earlier run left files, that they are still those."""
    if not folder.is_dir():
        return refusal
    earlier = f"{folder} keeps the files of an earlier run"
    remedy = f"{refusal.remedy}; {earlier}" if refusal.remedy else earlier
    return type(refusal)(refusal.place, refusal.found, expected=refusal.expected, remedy=remedy)


def _deliver_imu(unit: Path, build: Path, progress: Progress | None) -> Delivered:
    from triaxcal.api.imu import ImuCalibration  # noqa: PLC0415
    from triaxcal.base.publish import publish  # noqa: PLC0415
    from triaxcal.delivery.imu import deliver_imu  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files, dynamic_summary  # noqa: PLC0415
    from triaxcal.report.imuc import C_FILES  # noqa: PLC0415

    made = deliver_imu(unit, progress)
    files = dynamic_files(made)
    target = build / made.done.unit.name
    publish(files, target, C_FILES)
    text = dynamic_summary(made, files, str(target))
    return Delivered(target, tuple(files), ImuCalibration.of(made), text)
