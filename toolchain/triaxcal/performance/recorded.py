"""Recordings of tests, [test.NAME], read by the reader of all recordings and brought to g."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.types import FloatArray
from triaxcal.readings.samples import READING, TEMP, Samples, read_samples
from triaxcal.readings.table import GAP, TIME
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recordedtest import REST, StatedTest
from triaxcal.unit.recording import ACCELERATION_UNITS
from triaxcal.unit.recordingfile import files_in

_REST_G = (0.7, 1.3)
"""Mean |a| of a unit at rest: anything else is another unit of the readings."""


@dataclass(frozen=True)
class Recorded:
    """One file of a test.

    Attributes
    ----------
    source : str
    samples : Samples
    time_s : array, shape (n,)
        From the first sample.
    output_g : array, shape (n, 3)
        Outputs by the constants of T0: temperature is not compensated.
    compensated_g : array, shape (n, 3), or None
        By the fitted model; None without temperatures within its range.
    temp_degc : array, shape (n,), or None
    findings : tuple of str
    sha256 : str
    """

    source: str
    samples: Samples
    time_s: FloatArray
    output_g: FloatArray
    compensated_g: FloatArray | None
    temp_degc: FloatArray | None
    findings: tuple[str, ...]
    sha256: str


def read_test(
    unit: UnitDescription, calibration: Calibration, folder: Path, test: StatedTest
) -> tuple[Recorded, ...]:
    """Files of a test, each by itself.

    Raises
    ------
    RefusedError
        When one cannot be read, or its readings are not those of a unit at rest.
    """
    found = []
    for path in files_in(folder, test.keys.file):
        layout = test.layout(path.relative_to(folder).as_posix(), calibration.reading_unit)
        samples = read_samples(folder, layout, unit.temperature_sensor)
        raw, scale = samples.part(READING), _to_reading_unit(unit, calibration, test)
        found.append(_recorded(unit, calibration, test, path, samples, raw * scale))
    return tuple(found)


def _recorded(  # noqa: PLR0917
    unit: UnitDescription,
    calibration: Calibration,
    test: StatedTest,
    path: Path,
    samples: Samples,
    raw: FloatArray,
) -> Recorded:
    at = calibration.thermal.constants_at
    output = calibration.terms.force_g(force_from_voltage(at(unit.t0_degc), raw))
    size = float(np.linalg.norm(output.mean(axis=0)))
    if not _REST_G[0] <= size <= _REST_G[1]:
        raise RefusedError(
            str(path),
            f"a mean |a| of {size:.4g} g",
            expected="about 1 g of a unit at rest",
            remedy=f"check acceleration and acceleration_unit in [{test.table}]",
        )
    temp, compensated, findings = None, None, [*samples.table.findings, *_gaps(test, samples)]
    if TEMP in samples:
        temp = samples.part(TEMP)
        low, high = calibration.range_degc
        if low <= temp.min() and temp.max() <= high:
            compensated = calibration.terms.force_g(force_from_voltage(at(temp), raw))
        else:
            findings.append(
                f"{path.name}: {temp.min():.4g} to {temp.max():.4g} degC, not within the "
                f"calibrated {low:.4g} to {high:.4g}: the output is not compensated"
            )
    digest = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    return Recorded(
        path.name, samples, samples.part(TIME), output, compensated, temp, tuple(findings), digest
    )


def _gaps(test: StatedTest, samples: Samples) -> list[str]:
    """Lost samples, where they are not left out: a test at rest has its own words."""
    steps = np.diff(samples.part(TIME))
    lost = steps > GAP * samples.step_s
    if test.keys.kind == REST or not lost.any():
        return []
    count, first = int(lost.sum()), samples.place(int(np.argmax(lost)) + 1)
    words = f"{count} gap{'s' * (count != 1)} in time, the longest {steps.max():.3g} s, "
    return [f"{words}the first before {first}"]


def _to_reading_unit(unit: UnitDescription, calibration: Calibration, test: StatedTest) -> float:
    """Factor from the unit of a test's readings to that of the calibration."""
    found = test.keys.acceleration_unit or calibration.reading_unit
    wanted = calibration.reading_unit
    if found == wanted:
        return 1.0
    volts = {"V": 1.0, "mV": 1e-3, "count": unit.adc.volts_per_code}
    if unit.recording is None and found in volts:
        return volts[found]
    of_found, of_wanted = (ACCELERATION_UNITS.get(name) for name in (found, wanted))
    if of_found and of_wanted:
        return of_wanted / of_found
    raise RefusedError(
        f"{test.where} acceleration_unit",
        f"readings in {found}, and the unit is calibrated in {wanted}",
        expected="outputs as they were calibrated",
        remedy="record the same outputs as for the calibration",
    )
