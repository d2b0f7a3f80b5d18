"""`diagnose`: which cause explains a unit's readings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from triaxcal.api.unit import Unit, read_unit
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.facewords import diagnosis_by_face
from triaxcal.delivery.fitted import columns_of
from triaxcal.diagnosis import Diagnosis
from triaxcal.diagnosis import diagnose as _diagnose
from triaxcal.readings.measurements import MEASUREMENTS_FILE, measurements_of, read_measurements
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout


def diagnose(unit: Unit | str | Path, readings: Any = None) -> Diagnosis:
    """Rank the causes that could explain the readings of a unit.

    It needs no calibration: readings that are refused can be diagnosed. Of a recording it takes
    labelled faces as a tilter's six positions, and other poses by |a| = g.

    Parameters
    ----------
    unit : Unit, or path of its folder
    readings : mapping, data frame or structured array, or None
        Columns by name: of measurements.csv, or of the recording. None reads the unit's folder.

    Returns
    -------
    Diagnosis
        Its `suspects` are the causes by falling evidence, `answer` those that the readings do not
        tell from the best.

    Raises
    ------
    RefusedError
        When the readings break a rule of the file formats, hold no pose, are neither in the stated
        unit nor in another one or of another full scale, or are poses whose angles are known.
    """
    if isinstance(unit, str | Path):
        unit = read_unit(unit)
    description = unit.description
    if readings is None and unit.folder is None:
        raise RefusedError(f"unit {unit.name}", "made without a folder", expected="readings")
    if description.recording is not None:
        columns = None if readings is None else columns_of(readings)
        folder = unit.folder or Path()
        return _of_recording(description, description.recording, folder, columns)
    if readings is not None:
        return _diagnose(description, measurements_of(columns_of(readings), description))
    assert unit.folder is not None
    measurements = read_measurements(unit.folder / MEASUREMENTS_FILE, description)
    return _diagnose(description, measurements)


def _of_recording(
    unit: UnitDescription,
    layout: RecordingLayout,
    folder: Path,
    columns: Mapping[str, Any] | None,
) -> Diagnosis:
    if layout.angles is not None:
        raise RefusedError(
            f"unit {unit.name}",
            "has poses whose angles or directions are known",
            expected="a tilter, labelled faces, or poses of unknown direction",
            remedy="run `triaxcal calib`: it names wrong rows, exchanged columns and lost signs",
        )
    from triaxcal.diagnosis.poses.answer import diagnose_poses  # noqa: PLC0415
    from triaxcal.diagnosis.poses.causes.scale import factors  # noqa: PLC0415
    from triaxcal.fitting.recorded.faces import face_measurements  # noqa: PLC0415
    from triaxcal.poses.poses import find_poses  # noqa: PLC0415
    from triaxcal.readings.samples import read_samples  # noqa: PLC0415

    samples = read_samples(folder, layout, unit.temperature_sensor, columns)
    if layout.faces:
        return diagnosis_by_face(_diagnose(unit, face_measurements(unit, layout, samples)))
    one_g = layout.reading_of_1_g
    poses = find_poses(samples, layout, factors=factors(one_g) if one_g else ())
    return diagnose_poses(unit, layout, poses)
