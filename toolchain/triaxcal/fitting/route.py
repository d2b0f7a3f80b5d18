"""Which calibration a recording gets: what unit.toml says of its poses decides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.converter import as_converted, signs_of
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.judged import TEMPERATURE
from triaxcal.fitting.core.recorded import RecordingFit
from triaxcal.fitting.pair.cross_coupling import stated_pair
from triaxcal.fitting.recorded.calibrate import calibrate_poses
from triaxcal.fitting.recorded.faces import face_measurements
from triaxcal.fitting.recorded.temperatures import temperature_findings
from triaxcal.fitting.table.calibrate import calibrate_table
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.poses.stated import refuse_wrong_unit
from triaxcal.poses.steps import Steps
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.readings.samples import READING, TEMP, Samples, read_samples
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

_WIDTHS = (16, 17, 20, 24, 25, 32)
"""Raw codes that are tried for counts: signed 16, unsigned 16, and so on."""


def calibrate_recording(
    unit: UnitDescription,
    layout: RecordingLayout,
    folder: Path,
    given: Mapping[str, Any] | None = None,
) -> tuple[UnitDescription, MeasurementSet, Calibration]:
    """Unit with its raw codes settled, the poses as dwells, and the calibration.

    Readings and constants are those of the columns as the converter gives them (`converter`).
    `given` are columns of a program, in place of the recording's file.

    Raises
    ------
    RefusedError
        When the recording cannot be read, or its poses do not carry a calibration.
    """
    pair = stated_pair(unit, folder)
    known = np.zeros((3, 6)) if pair is None else pair.quadratic
    samples = read_samples(folder, layout, unit.temperature_sensor, given)
    unit = replace(unit, adc=_wide_enough(unit, layout, samples))
    if layout.faces:
        measurements = face_measurements(unit, layout, samples)
        found = calibrate(unit, measurements, pair)
        unseen = temperature_findings(unit, samples.extremes(TEMP) if TEMP in samples else None)
        calibration = replace(
            found,
            reading_unit=layout.acceleration_unit,
            notes=(*samples.findings, *found.notes, *unseen),
        )
        return unit, *as_converted(layout, measurements, calibration)
    if layout.angles is not None:
        measurements, calibration = calibrate_table(unit, layout, layout.angles, samples, known)
    else:
        measurements, calibration = calibrate_poses(unit, layout, samples, known)
    recording = calibration.recording
    assert recording is not None
    of_pair = () if pair is None else pair.findings
    recording = replace(recording, findings=(*recording.findings, *of_pair))
    calibration = replace(calibration, recording=recording, pair=pair)
    return unit, *as_converted(layout, measurements, calibration)


def _wide_enough(unit: UnitDescription, layout: RecordingLayout, samples: Samples) -> Adc:
    """The ADC, widened to hold the readings where unit.toml left its bits open."""
    adc = unit.adc
    lsb = adc.volts_per_code
    # Half a code: readings in other units than counts are not rounded to codes.
    extremes = samples.extremes(READING) * signs_of(layout.acceleration)
    low, high = float(extremes.min()) / lsb + 0.5, float(extremes.max()) / lsb - 0.5
    if adc.code_min <= low and high <= adc.code_max:
        return adc
    fitting = [b for b in _WIDTHS if -(2 ** (b - 1)) <= low and high <= 2 ** (b - 1) - 1]
    if unit.adc_open and fitting:
        bits = fitting[0]
        half = 2 ** (bits - 1)
        return Adc(bits, lsb * half, -half, half - 1)
    # Readings in another unit than stated need no wider converter.
    rows = np.concatenate(samples.table.spool.stretches())
    refuse_wrong_unit(samples.source, samples.cut(rows, READING), layout, Steps.of(samples))
    largest = float(np.abs(extremes).max())
    index = next(
        first + int(np.argmax(size))
        for first, rows in samples.pieces()
        if (size := np.abs(samples.cut(rows, READING)).max(axis=1)).max() == largest
    )
    wide = f"bits = {fitting[0]}" if fitting else "a larger lsb"
    raise RefusedError(
        samples.place(index),
        f"a reading of {largest:.6g} {layout.acceleration_unit}, {largest / lsb:.0f} codes",
        expected=f"{adc.code_min} to {adc.code_max} codes of [adc]",
        remedy=f"set [adc] {wide}, or correct lsb, code_min and code_max",
    )


def refuse_poses_beyond_limits(unit: UnitDescription, calibration: Calibration) -> None:
    """P1 (13) at the poses and at held-out poses; the compiled C is checked again afterwards."""
    recording = calibration.recording
    if recording is None:
        return
    errors = recording.residual_g
    poses = recording.poses.poses
    temps = [unit.t0_degc if p.temp_degc is None else p.temp_degc for p in poses]
    limits = np.array([unit.limits.at(t, unit.t0_degc)[0] for t in temps])
    worst = int((np.abs(errors) / limits).argmax())
    if abs(errors[worst]) <= limits[worst]:
        _refuse_held_out(unit, recording, temps)
        return
    pose = poses[worst]
    key = unit.limits.at(temps[worst], unit.t0_degc)[1]
    raise RefusedError(
        f"{recording.poses.source}, line {pose.line}",
        f"| |a| - g | = {abs(errors[worst]) * 1e3:.4g} mg in pose {pose.number}, rms over "
        f"the poses {recording.rms_g * 1e3:.3g} mg",
        expected=f"at most {limits[worst] * 1e3:g} mg ({key})",
        remedy="check that pose with `triaxcal poses`; if it is good, state the limit that "
        "this sensor keeps",
    )


@dataclass(frozen=True)
class _Missed:
    """Poses held out that have one limit in common: their rms error, and the worst of them."""

    what: str
    limit_g: float
    key: str
    rms_g: float
    worst: int
    error_g: float


def _held_out_groups(
    unit: UnitDescription, recording: RecordingFit, temps: Sequence[float]
) -> list[_Missed]:
    """Held-out errors by the limit of their pose; temperatures held out have that over the range.

    The latter show the curves between the calibrated temperatures, as those of a tilter do.
    """
    found = []
    for held in recording.held_out:
        over = unit.limits.over_range_g, "limits.over_range_g"
        own = [
            over if held.what == TEMPERATURE else unit.limits.at(temps[k], unit.t0_degc)
            for k in held.poses
        ]
        for limit_g, key in sorted(set(own)):
            at = [n for n, limit in enumerate(own) if limit == (limit_g, key)]
            errors = np.abs(held.error_g[at])
            worst = int(errors.argmax())
            rms = float(np.sqrt(np.mean(errors**2)))
            found.append(
                _Missed(held.what, limit_g, key, rms, held.poses[at[worst]], float(errors[worst]))
            )
    return found


def _refuse_held_out(
    unit: UnitDescription, recording: RecordingFit, temps: Sequence[float]
) -> None:
    """Refuse an error at unseen poses that is beyond the limit, whatever the residual is."""
    groups = _held_out_groups(unit, recording, temps)
    missed = max(groups, key=lambda m: m.rms_g / m.limit_g, default=None)
    if missed is None or missed.rms_g <= missed.limit_g:
        return
    pose = recording.poses.poses[missed.worst]
    at = "" if pose.temp_degc is None else f" at {pose.temp_degc:.4g} degC"
    remedy = "record more poses, in different orientations"
    if missed.what == TEMPERATURE:
        remedy = "record poses at more temperatures, or choose another function in [thermal]"
    raise RefusedError(
        f"{recording.poses.source}, line {pose.line}",
        f"| |a| - g | = {missed.rms_g * 1e3:.4g} mg rms at held-out poses, with each "
        f"{missed.what} held out in turn; the largest is {missed.error_g * 1e3:.4g} mg in pose "
        f"{pose.number}{at}; the fit's residual is {recording.rms_g * 1e3:.3g} mg rms",
        expected=f"at most {missed.limit_g * 1e3:g} mg ({missed.key})",
        remedy=f"{remedy}; `triaxcal poses` shows those that there are",
    )
