"""Poses of a recording that was made with a delivered calibration: for a check, or an update."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import Pose, PoseSet, find_poses
from triaxcal.readings.identity import refuse_other_serial
from triaxcal.readings.measurements import MeasurementSet, measurements_of, read_measurements
from triaxcal.readings.samples import read_samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import ACCELERATION_UNITS, RecordingLayout

_VOLTS = {"V": 1.0, "mV": 1e-3}


@dataclass(frozen=True)
class FieldPoses:
    """Poses of one recording, as readings of a calibration.

    Attributes
    ----------
    source : str
    names : tuple of str
        Of the poses, with their lines, for messages.
    readings : array, shape (n, 3)
        As the converter gives them, in the calibration's unit.
    sd : array, shape (n, 3)
        Standard error of `readings`; NaN where it is unknown.
    temps_degc : array, shape (n,)
    findings : tuple of str
    poses : PoseSet
        The same as a recording's; of a tilter each dwell is one.
    """

    source: str
    names: tuple[str, ...]
    readings: FloatArray
    sd: FloatArray
    temps_degc: FloatArray
    findings: tuple[str, ...]
    poses: PoseSet

    def __len__(self) -> int:
        return len(self.names)

    def select(self, kept: list[int]) -> FieldPoses:
        """Only poses of these indices."""
        poses = replace(self.poses, poses=tuple(self.poses.poses[k] for k in kept))
        return FieldPoses(
            self.source,
            tuple(self.names[k] for k in kept),
            self.readings[kept],
            self.sd[kept],
            self.temps_degc[kept],
            self.findings,
            poses,
        )


def known_poses(poses: FieldPoses, measured: MeasurementSet) -> int:
    """Number of poses whose readings and temperature are those of dwells of a calibration."""
    own = {(*np.abs(d.voltage_v).tolist(), d.temp_degc) for d in measured.dwells}
    rows = np.column_stack([np.abs(poses.readings), poses.temps_degc]).tolist()
    return sum(tuple(row) in own for row in rows)


def field_poses(
    unit: UnitDescription,
    calibration: Calibration,
    recorded: Path | Mapping[str, Any],
    layout: RecordingLayout | None = None,
) -> FieldPoses:
    """Poses of a file, or of columns by name.

    Parameters
    ----------
    unit : UnitDescription
        Of the calibration: its [recording] says what the columns are; without one the file is a
        measurements.csv.
    recorded : Path, or columns
    layout : RecordingLayout or None
        Of the file, in place of the unit's.

    Raises
    ------
    RefusedError
        When the file cannot be read, names another serial number, has no still pose, or is in
        another unit than the calibration.
    """
    if isinstance(recorded, Path) and not recorded.exists():
        raise RefusedError(
            str(recorded), "no such file", expected="a recording", remedy="check its name"
        )
    if layout is not None:
        return _of_layout(unit, calibration, recorded, layout)
    try:
        if unit.recording is None:
            return _of_dwells(unit, recorded)
        return _of_layout(unit, calibration, recorded, unit.recording)
    except RefusedError as refusal:
        if refusal.remedy and unit.recording is not None:
            raise
        other = "a file of another form needs its own layout, a TOML file with [recording]"
        remedy = f"{refusal.remedy}; {other}" if refusal.remedy else other
        raise type(refusal)(
            refusal.place, refusal.found, expected=refusal.expected, remedy=remedy
        ) from refusal


def _of_layout(
    unit: UnitDescription,
    calibration: Calibration,
    recorded: Path | Mapping[str, Any],
    layout: RecordingLayout,
) -> FieldPoses:
    # Only |a| is judged: the file needs no angles.
    names = ("pitch", "roll", "yaw", "zenith", "tool_face", "azimuth", "direction")
    no_angles = dict.fromkeys(names)
    layout = replace(layout, **no_angles, angle_unit=None)  # type: ignore[arg-type]
    if isinstance(recorded, Path):
        layout = replace(layout, file=(recorded.name,))
        refuse_other_serial(recorded, layout.written, unit.serial)
        samples = read_samples(recorded.parent, layout, unit.temperature_sensor)
    else:
        samples = read_samples(Path(), layout, unit.temperature_sensor, recorded)
    signs = np.array([-1.0 if name.startswith("-") else 1.0 for name in calibration.inputs])
    scale = _scale(unit, calibration, layout) * (signs if len(signs) else np.ones(3))
    return _of_poses(unit, find_poses(samples, layout, any_unit=True), scale)


def _of_poses(unit: UnitDescription, found: PoseSet, scale: FloatArray) -> FieldPoses:
    poses = tuple(replace(pose, reading=pose.reading * scale) for pose in found.poses)
    sds = [np.full(3, np.nan) if p.sd_mean is None else p.sd_mean * np.abs(scale) for p in poses]
    sd = np.array(sds)
    findings = list(found.findings)
    temps = found.temps_degc
    if temps is None:
        temps = np.full(len(poses), unit.t0_degc)
        findings.append(f"no temperature is recorded: taken for {unit.t0_degc:g} degC")
    return FieldPoses(
        found.source,
        tuple(f"pose {pose.number}, line {pose.line}" for pose in poses),
        np.array([pose.reading for pose in poses]),
        np.where(np.isfinite(sd), sd, np.nan),
        temps,
        tuple(findings),
        replace(found, poses=poses),
    )


def _of_dwells(unit: UnitDescription, recorded: Path | Mapping[str, Any]) -> FieldPoses:
    """Dwells of a measurements.csv; of each only |a| is used, whatever its position."""
    measured = (
        read_measurements(recorded, unit)
        if isinstance(recorded, Path)
        else measurements_of(recorded, unit)
    )
    dwells = measured.dwells
    variances = [d.variance_of_mean_v2 for d in dwells]
    sd = np.array([np.full(3, np.nan) if v is None else np.sqrt(v) for v in variances])
    poses = tuple(
        Pose(
            k, d.row, 0.0, 0.0, d.voltage_v, sd[k - 1], d.count or 1, d.temp_degc, d.position, None
        )
        for k, d in enumerate(dwells, start=1)
    )
    return FieldPoses(
        measured.source,
        tuple(f"{d.position}, row {d.row}" for d in dwells),
        np.array([d.voltage_v for d in dwells]),
        sd,
        np.array([d.temp_degc for d in dwells]),
        (),
        PoseSet(measured.source, poses, (), None, ()),
    )


def _scale(unit: UnitDescription, calibration: Calibration, layout: RecordingLayout) -> float:
    """What a reading of the file is in the calibration's unit."""
    own, theirs = calibration.reading_unit, layout.acceleration_unit
    if own == theirs:
        return 1.0
    if theirs == "count":
        return unit.adc.volts_per_code
    if own in _VOLTS and theirs in _VOLTS:
        return _VOLTS[theirs] / _VOLTS[own]
    one_g, of_file = ACCELERATION_UNITS[own], ACCELERATION_UNITS[theirs]
    if one_g is None or of_file is None:
        raise RefusedError(
            f"{unit.name}, acceleration_unit",
            f"the recording is in {theirs}, the calibration in {own}",
            expected=f"readings in {own}, or in codes of the converter",
            remedy="give the layout of the recording, with its unit",
        )
    return one_g / of_file


def inside_range(found: FieldPoses, range_degc: tuple[float, float]) -> FieldPoses:
    """Poses within a working range; those outside are reported.

    Raises
    ------
    RefusedError
        When none is inside.
    """
    low, high = range_degc
    inside = (found.temps_degc >= low) & (found.temps_degc <= high)
    if inside.all():
        return found
    coldest, warmest = float(found.temps_degc.min()), float(found.temps_degc.max())
    if not inside.any():
        at = " to ".join(dict.fromkeys((f"{coldest:.4g}", f"{warmest:.4g}")))
        raise RefusedError(
            found.source,
            f"no pose of {len(found)} is within: {at} degC",
            expected=f"{low:g} to {high:g} degC, the range of the calibration",
            remedy="record within the range, or calibrate over a wider one",
        )
    left = int((~inside).sum())
    words = f"{left} of {len(found)} poses are outside of {low:g} to {high:g} degC and not used"
    kept = found.select(np.flatnonzero(inside).tolist())
    return replace(kept, findings=(*kept.findings, words))
