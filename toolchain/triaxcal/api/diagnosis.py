"""`diagnose`: which cause explains a unit's readings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.api.unit import Unit, read_unit
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import columns_of
from triaxcal.diagnosis import Diagnosis
from triaxcal.diagnosis import diagnose as _diagnose
from triaxcal.readings.measurements import MEASUREMENTS_FILE, measurements_of, read_measurements


def diagnose(unit: Unit | str | Path, readings: Any = None) -> Diagnosis:
    """Rank the causes that could explain the readings of a unit on a tilter.

    It needs no calibration: readings that are refused can be diagnosed.

    Parameters
    ----------
    unit : Unit, or path of its folder
    readings : mapping, data frame or structured array, or None
        Columns of measurements.csv by name. None reads the unit's folder.

    Returns
    -------
    Diagnosis
        Its `suspects` are the causes by falling evidence, `answer` those that the readings do not
        tell from the best.

    Raises
    ------
    RefusedError
        When the readings break a rule of the file formats, or are a recording.
    """
    if isinstance(unit, str | Path):
        unit = read_unit(unit)
    description = unit.description
    if description.recording is not None:
        raise RefusedError(
            f"unit {unit.name}",
            "has [recording]",
            expected="a unit on a tilter",
            remedy="run `triaxcal calib`; read its `found` lines",
        )
    if readings is not None:
        return _diagnose(description, measurements_of(columns_of(readings), description))
    if unit.folder is None:
        raise RefusedError(f"unit {unit.name}", "made without a folder", expected="readings")
    measurements = read_measurements(unit.folder / MEASUREMENTS_FILE, description)
    return _diagnose(description, measurements)
