"""Which calibration a recording gets: what unit.toml says of its poses decides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.converter import as_converted, signs_of
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.pair.cross_coupling import stated_pair
from triaxcal.fitting.recorded.calibrate import calibrate_poses
from triaxcal.fitting.recorded.faces import face_measurements
from triaxcal.fitting.recorded.temperatures import temperature_findings
from triaxcal.fitting.table.calibrate import calibrate_table
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.fitting.tilter.mounting import unequal_output
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
        _refuse_unequal(unit, layout, samples.source, found)
        unseen = temperature_findings(unit, samples.extremes(TEMP) if TEMP in samples else None)
        calibration = replace(
            found,
            reading_unit=layout.acceleration_unit,
            notes=(*samples.findings, *found.notes, *unseen),
        )
        return unit, *as_converted(layout, measurements, calibration)
    if layout.angles is not None:
        measurements, calibration = calibrate_table(unit, layout, layout.angles, samples, known)
        _refuse_unequal(unit, layout, samples.source, calibration)
    else:
        measurements, calibration = calibrate_poses(unit, layout, samples, known)
    recording = calibration.recording
    assert recording is not None
    of_pair = () if pair is None else pair.findings
    recording = replace(recording, findings=(*recording.findings, *of_pair))
    calibration = replace(calibration, recording=recording, pair=pair)
    return unit, *as_converted(layout, measurements, calibration)


def _refuse_unequal(
    unit: UnitDescription, layout: RecordingLayout, source: str, calibration: Calibration
) -> None:
    """Refuse an output whose readings are not in the unit that is stated for all three."""
    odd = unequal_output(calibration.thermal.constants_at(unit.t0_degc))
    if layout.reading_of_1_g is None or odd is None:
        return
    axis, ratio = odd
    raise RefusedError(
        source,
        f"output {axis} is {ratio:.3g} times as sensitive as the other outputs: its full scale or "
        "gain is another one",
        expected=f"three outputs in {layout.acceleration_unit}",
        remedy=f"correct the scale of the column of {axis}; if it is the converter's own, "
        'acceleration_unit = "count"',
    )


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
