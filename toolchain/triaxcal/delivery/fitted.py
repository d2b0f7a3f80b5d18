"""A unit and its readings -> its calibration, and whether it keeps the unit's limits."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.jsontext import json_bytes
from triaxcal.base.plaindata import plain
from triaxcal.base.tomltable import content_of, text_of
from triaxcal.delivery.causes import refuse_certain_fault, with_cause
from triaxcal.delivery.coderange import settled_codes
from triaxcal.delivery.facewords import by_face, named_by_face
from triaxcal.delivery.inputs import inputs_sha256, without_papers
from triaxcal.delivery.posecauses import refuse_certain_fault_of_poses, with_pose_cause
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.recorded import PairTerms
from triaxcal.fitting.recorded.acceptance import refuse_poses_beyond_limits
from triaxcal.fitting.tilter.acceptance import refuse_unacceptable
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.readings.measurements import (
    MEASUREMENTS_FILE,
    MeasurementSet,
    measurements_of,
    read_measurements,
)
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.folder import UNIT_FILE


@dataclass(frozen=True)
class Fitted:
    """A unit, what was measured, and the calibration.

    Attributes
    ----------
    unit : UnitDescription
        Its raw codes settled, where a recording left them open or own-axis squares need fewer.
    measurements : MeasurementSet
        Dwells, or the poses of a recording as dwells.
    inputs_sha256 : str
        Hash of the files, or of the arrays, that went in.
    calibration : Calibration
    """

    unit: UnitDescription
    measurements: MeasurementSet
    inputs_sha256: str
    calibration: Calibration


def fit_folder(unit: UnitDescription, folder: Path) -> Fitted:
    """Calibration of a unit from the readings in its folder, whether or not it keeps the limits.

    Raises
    ------
    RefusedError
        When the readings cannot be read, do not carry a calibration, or change meanwhile.
    """
    inputs = inputs_sha256(folder, unit)
    if text_of(content_of(folder / UNIT_FILE)) != unit.toml:
        raise _changed(folder / UNIT_FILE)
    if unit.recording is not None:
        # SciPy's optimizers take as long to import as a whole tilter's calibration does.
        from triaxcal.fitting.route import calibrate_recording  # noqa: PLC0415

        with named_by_face(unit):
            unit, measurements, calibration = calibrate_recording(unit, unit.recording, folder)
        calibration = _findings_by_face(unit, calibration)
    else:
        measurements = read_measurements(folder / MEASUREMENTS_FILE, unit)
        calibration = _of_tilter(unit, measurements, _stated_pair(unit, folder))
        unit, calibration = settled_codes(unit, calibration)
    if inputs_sha256(folder, unit) != inputs:
        raise _changed(folder)
    return Fitted(unit, measurements, inputs, calibration)


def _stated_pair(unit: UnitDescription, folder: Path) -> PairTerms | None:
    if unit.pair is None:
        return None
    from triaxcal.fitting.pair.cross_coupling import stated_pair  # noqa: PLC0415

    return stated_pair(unit, folder)


def _findings_by_face(unit: UnitDescription, calibration: Calibration) -> Calibration:
    if unit.recording is None or not unit.recording.faces:
        return calibration
    return replace(calibration, notes=tuple(map(by_face, calibration.notes)))


def _of_tilter(
    unit: UnitDescription, measurements: MeasurementSet, pair: PairTerms | None
) -> Calibration:
    """Calibration; a refusal names the cause that explains the readings best."""
    try:
        return calibrate(unit, measurements, pair)
    except RefusedError as refusal:
        raise with_cause(refusal, unit, measurements) from None


def _changed(path: Path) -> RefusedError:
    return RefusedError(str(path), "changed while it was read", remedy="read it again")


def fit_columns(unit: UnitDescription, readings: Any) -> Fitted:
    """Calibration of a unit from columns by name: a mapping, data frame or structured array.

    Raises
    ------
    RefusedError
        When there are no columns, or they do not carry a calibration.
    """
    columns = columns_of(readings)
    if unit.pair is not None:
        raise RefusedError(
            f"unit {unit.name}",
            "has [quadratic], whose readings are a file",
            expected="the unit's folder with it",
            remedy="read the unit with read_unit(folder) and call fit(unit)",
        )
    digest = hashlib.sha256(without_papers(unit.toml.encode()))
    if unit.recording is not None:
        from triaxcal.fitting.route import calibrate_recording  # noqa: PLC0415

        for name, values in sorted(columns.items()):
            digest.update(
                f"{name} {hashlib.sha256(np.asarray(values).tobytes()).digest()!r}".encode()
            )
        with named_by_face(unit):
            unit, measurements, calibration = calibrate_recording(
                unit, unit.recording, Path(), columns
            )
        calibration = _findings_by_face(unit, calibration)
    else:
        measurements = measurements_of(columns, unit)
        digest.update(json_bytes(plain(measurements)))
        calibration = _of_tilter(unit, measurements, None)
        unit, calibration = settled_codes(unit, calibration)
    return Fitted(unit, measurements, digest.hexdigest(), calibration)


def columns_of(readings: Any) -> Mapping[str, Any]:
    """Columns of a mapping, a data frame or a structured array."""
    names = getattr(getattr(readings, "dtype", None), "names", None)
    if names is None:
        names = getattr(readings, "columns", readings if isinstance(readings, Mapping) else None)
    if names is None:
        raise RefusedError(
            "readings",
            f"a {type(readings).__name__} has no columns",
            expected="a mapping of columns by name, a data frame or a structured array",
        )
    return {str(name): readings[name] for name in names}


def refuse_beyond_limits(fitted: Fitted) -> None:
    """Refuse a calibration that misses its own readings by more than the unit's limits, P1 (13).

    Raises
    ------
    RefusedError
        Names the readings at fault, or the thermal function, and what to do.
    """
    with named_by_face(fitted.unit):
        _refuse_beyond_limits(fitted)


def _refuse_beyond_limits(fitted: Fitted) -> None:
    if fitted.calibration.recording is None:
        parts = fitted.unit, fitted.measurements, fitted.calibration
        try:
            refuse_unacceptable(fitted.unit, fitted.calibration, fitted.measurements)
        except RefusedError as refusal:
            raise with_cause(refusal, *parts, contradiction=True) from None
        if fitted.unit.recording is None:  # faces that a hand has set are judged by their limits
            refuse_certain_fault(*parts)
        return
    unit, calibration = fitted.unit, fitted.calibration
    try:
        refuse_poses_beyond_limits(unit, calibration)
    except RefusedError as refusal:
        raise with_pose_cause(refusal, unit, calibration) from None
    refuse_certain_fault_of_poses(unit, calibration)
