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
    from triaxcal.api.field import Updated
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

    def __str__(self) -> str:
        return self.summary

    def __repr__(self) -> str:
        """Short: the calibration holds whole arrays."""
        return f"<{type(self).__name__} in {self.folder}>\n{self.summary}"


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
    from triaxcal.base.publish import publish_beside  # noqa: PLC0415
    from triaxcal.delivery.saved import Saved  # noqa: PLC0415
    from triaxcal.delivery.unit import deliver as made_of  # noqa: PLC0415
    from triaxcal.device.record import read_record, record_path  # noqa: PLC0415
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
    target = build / delivery.unit.name
    made = passport(delivery, {}, read_record(record_path(target)))
    files = all_files(delivery, made)
    kept = _kept_update(target)
    publish_beside(files, target, kept, SOMETIMES)
    calibration = Calibration(Unit.of(delivery.unit, unit), Saved.of(delivery))
    text = summary(made, files, str(target))
    if kept is not None:
        text += f"\n\nthe update by poses from the field that was there is kept in {kept}/"
    return Delivered(target, tuple(files), calibration, text, warnings)


def _kept_update(target: Path) -> Path | None:
    """Where an update by poses from the field is kept that lies in `target`; None without one."""
    import json  # noqa: PLC0415

    try:
        document = json.loads((target / "calibration.json").read_bytes())
        inputs = str(document["inputs_sha256"]) if document.get("update") else ""
    except (OSError, ValueError, KeyError, AttributeError, RecursionError):
        return None
    return target.with_name(f"{target.name}.{inputs[:8]}") if inputs else None


def _beside_earlier(refusal: RefusedError, folder: Path) -> RefusedError:
    """The refusal; where an earlier run left files, that they are still those."""
    if not folder.is_dir():
        return refusal
    earlier = f"{folder} keeps the files of an earlier run"
    remedy = f"{refusal.remedy}; {earlier}" if refusal.remedy else earlier
    return type(refusal)(refusal.place, refusal.found, expected=refusal.expected, remedy=remedy)


def update(
    folder: str | Path,
    recorded: str | Path,
    build: str | Path = "build",
    *,
    into: str | Path | None = None,
    layout: str | Path | None = None,
    gravity_m_per_s2: float | None = None,
    bias_drift_mg: float | None = None,
    scale_drift_ppm: float | None = None,
    axes_drift_micro_rad: float | None = None,
) -> Delivered:
    """Bring a delivered calibration up to date by a few poses from the field, and deliver it.

    Parameters
    ----------
    folder : path
        Of the unit, whose calibration is in the folder of its name below `build`; or a delivered
        folder, or its calibration.json: nothing else of the unit is needed.
    recorded : path
        Recording of one still pose or more, in the layout of the unit.
    build : path
        The delivered files are replaced, all or none; those before are kept beside them in a folder
        of the same name and the first eight digits of their inputs_sha256.
    into : path or None
        Folder that receives a folder of the unit's name instead.
    layout : path or None
        TOML file whose [recording] says what the columns are, in place of the unit's.
    gravity_m_per_s2 : float or None
        Local gravity where it was recorded; None is that of the unit.
    bias_drift_mg, scale_drift_ppm, axes_drift_micro_rad : float or None
        Standard deviations of the drift that is allowed for; None follows from the unit's limits.

    Raises
    ------
    RefusedError
        When there is no calibration, the recording has no still pose or contradicts it, or the
        result is refused; nothing is written then.
    """
    from triaxcal.api.calibration import load  # noqa: PLC0415
    from triaxcal.api.field import bring_up_to_date  # noqa: PLC0415

    source = delivered_file(Path(folder), Path(build))
    done = load(source).fitted
    drift = bias_drift_mg, scale_drift_ppm, axes_drift_micro_rad
    made = bring_up_to_date(done, recorded, layout, gravity_m_per_s2, drift)
    target = source.parent if into is None else Path(into) / done.unit.name
    before = done.inputs_sha256[:8]
    kept = target.with_name(f"{target.name}.{before}") if into is None else None
    return _deliver_update(made, target, kept)


def _deliver_update(made: Updated, target: Path, kept: Path | None) -> Delivered:
    from triaxcal.api.calibration import Calibration  # noqa: PLC0415
    from triaxcal.api.unit import Unit  # noqa: PLC0415
    from triaxcal.base.publish import publish_beside  # noqa: PLC0415
    from triaxcal.delivery.saved import Saved  # noqa: PLC0415
    from triaxcal.delivery.unit import deliver_fitted  # noqa: PLC0415
    from triaxcal.device.record import read_record, record_path  # noqa: PLC0415
    from triaxcal.report.files import SOMETIMES, all_files  # noqa: PLC0415
    from triaxcal.report.passport.content import passport  # noqa: PLC0415
    from triaxcal.report.summary import summary  # noqa: PLC0415
    from triaxcal.report.update import changed_text  # noqa: PLC0415

    with reference_under_way() as reference:
        delivery = deliver_fitted(made.fitted, reference)
    page = passport(delivery, {}, read_record(record_path(target)))
    files = all_files(delivery, page)
    publish_beside(files, target, kept, SOMETIMES)
    changed = changed_text(delivery.unit.serial, made.found, made.before.calibration)
    text = f"{changed}\n\n{summary(page, files, str(target))}"
    if kept is not None:
        text += f"\n\nthe files before are kept in {kept}/"
    calibration = Calibration(Unit.of(delivery.unit, None), Saved.of(delivery))
    return Delivered(target, tuple(files), calibration, text)


def delivered_file(unit: Path, build: Path) -> Path:
    """calibration.json that was delivered for a unit.

    `unit` is its folder, a delivered folder or the file itself. The folder of the unit need not be
    there: what was delivered is whole.

    Raises
    ------
    RefusedError
        When there is no such unit, or nothing was delivered.
    """
    from triaxcal.unit.folder import find_unit  # noqa: PLC0415

    name = "calibration.json"
    path = build / unit.absolute().name / name
    if unit.is_file() and unit.suffix != ".json":
        raise RefusedError(
            str(unit), "a file", expected=f"a unit, a delivered folder or its {name}"
        )
    for found in (unit, unit / name, path):
        if found.is_file():
            return found
    find_unit(unit)
    raise RefusedError(
        str(path),
        "no such file",
        expected="a delivered calibration",
        remedy=f"run `triaxcal calib {unit}` first, or name its folder with --build",
    )


def _deliver_imu(unit: Path, build: Path, progress: Progress | None) -> Delivered:
    from triaxcal.api.imu import ImuCalibration  # noqa: PLC0415
    from triaxcal.base.publish import publish  # noqa: PLC0415
    from triaxcal.delivery.imu import deliver_imu  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files, dynamic_summary  # noqa: PLC0415
    from triaxcal.report.imuc import C_FILES  # noqa: PLC0415

    target = build / unit.absolute().name
    try:
        made = deliver_imu(unit, progress)
    except RefusedError as refusal:
        raise _beside_earlier(refusal, target) from refusal
    files = dynamic_files(made)
    publish(files, target, C_FILES)
    text = dynamic_summary(made, files, str(target))
    return Delivered(target, tuple(files), ImuCalibration.of(made), text)
