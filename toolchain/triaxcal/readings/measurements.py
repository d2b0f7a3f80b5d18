"""Measurement records: one row per dwell, units/<UNIT>/measurements.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements_csv import (
    DEVIATIONS,
    READINGS,
    Header,
    Row,
    read_rows,
    rows_of,
    write_measurements,
)
from triaxcal.readings.numbertext import is_number
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription

__all__ = ["Dwell", "MeasurementSet", "read_measurements", "volts", "write_measurements"]

MEASUREMENTS_FILE = "measurements.csv"
_POSITIONS = (*TEST_POSITIONS, *CHECK_POSITIONS)
RealT = TypeVar("RealT", float, FloatArray)
_COUNT_MAX = 10**9
_SMALLEST_PEAK = 1 / 500
"""Of the ADC's full scale: a file whose largest reading is below this is in the wrong unit.

Under 1 g a sensible sensor uses far more of its ADC; volts taken for mV give 1/1000 of it.
"""


@dataclass(frozen=True)
class Dwell:
    """Mean of the readings while the unit rested in one position at one temperature.

    Attributes
    ----------
    row : int
        Line of the file, for messages; the first is line 1.
    position : str
        "TP1" to "TP6" (fitted), "CP1" to "CP6" (only checked).
    voltage_v : array, shape (3,)
        Mean outputs Ux, Uy, Uz in V.
    count : int or None
        Number of independent readings in the mean; None if the file does not state it.
    sd_v : array, shape (3,), or None
        Standard deviation of one reading, V.
    rate_k_per_s : float
        dT/dt, where a term in it is fitted.
    """

    row: int
    position: str
    temp_degc: float
    voltage_v: FloatArray
    count: int | None
    sd_v: FloatArray | None
    rate_k_per_s: float = 0.0

    @property
    def variance_of_mean_v2(self) -> FloatArray | None:
        """Variance of the mean, shape (3,), V^2: sd^2 / count; None when not recorded."""
        if self.sd_v is None or self.count is None:
            return None
        return self.sd_v**2 / self.count


@dataclass(frozen=True)
class MeasurementSet:
    """All dwells of one file, in its order; `source` names the file in messages."""

    source: str
    dwells: tuple[Dwell, ...]


def read_measurements(path: Path, unit: UnitDescription) -> MeasurementSet:
    """Dwells of a measurements.csv, readings converted to V by the unit's ADC.

    Which positions and temperatures there must be is for the fit to say.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/reference/file-formats.md; names row and column.
    """
    return _measurements(str(path), *read_rows(path), unit)


def measurements_of(columns: Mapping[str, Any], unit: UnitDescription) -> MeasurementSet:
    """Dwells of columns by name, with the names, units and rules of measurements.csv.

    Raises
    ------
    RefusedError
        As `read_measurements`; for columns of different lengths. Rows are counted from 1.
    """
    return _measurements("readings", *rows_of(columns), unit)


def _measurements(
    source: str, header: Header, rows: Sequence[Row], unit: UnitDescription
) -> MeasurementSet:
    peak = _peak(header, rows)
    dwells = tuple(_dwell(row, header, unit, peak) for row in rows)
    _refuse_wrong_unit(source, header, dwells, unit.adc)
    return MeasurementSet(source=source, dwells=dwells)


def volts(values: RealT, reading_unit: str, adc: Adc) -> RealT:
    """Readings in V of readings in "v", "mv" or "code": one, or an array of any shape."""
    if reading_unit == "code":
        return values * adc.volts_per_code
    return values / 1000.0 if reading_unit == "mv" else values


def _peak(header: Header, rows: Sequence[Row]) -> float:
    """Largest reading of the file, as written; cells that are no numbers are reported later."""
    cells = [row.cells[column] for row in rows for column in READINGS[header.reading_unit]]
    return max((abs(float(c)) for c in cells if is_number(c)), default=0.0)


def _dwell(row: Row, header: Header, unit: UnitDescription, peak: float) -> Dwell:
    position = row.cells["position"]
    if position not in _POSITIONS:
        expected = "TP1 to TP6 (fitted) or CP1 to CP6 (only checked)"
        raise row.refuse("position", expected + did_you_mean(position, _POSITIONS))
    sd_v = None
    if header.has_deviations:
        sd_v = _frozen([_deviation(row, c, header, unit) for c in DEVIATIONS[header.reading_unit]])
    columns = READINGS[header.reading_unit]
    return Dwell(
        row=row.line,
        position=position,
        temp_degc=_temperature(row, header, unit),
        voltage_v=_frozen([_reading(row, c, header, unit, peak) for c in columns]),
        count=row.whole("count", 1, _COUNT_MAX) if header.has_count else None,
        sd_v=sd_v,
    )


def _frozen(values: list[float]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _temperature(row: Row, header: Header, unit: UnitDescription) -> float:
    column = f"temp_{header.temperature_unit}"
    value = row.number(column)
    temp_degc = unit.temperature_sensor.degc(value) if column == "temp_code" else value
    low, high = PLAUSIBLE_DEGC
    if not low <= temp_degc <= high:
        stands_for = f", which is {temp_degc:g} degC" if column == "temp_code" else ""
        raise RefusedError(
            row.where(column),
            f"found {shown(row.cells[column])}{stands_for}",
            expected=f"{low:g} to {high:g} degC",
            remedy="if these are codes, name the column temp_code" if not stands_for else "",
        )
    return temp_degc


def _reading(row: Row, column: str, header: Header, unit: UnitDescription, peak: float) -> float:
    """Reading in V, refused beyond the declared codes of the ADC."""
    adc = unit.adc
    value = row.number(column)
    voltage_v = volts(value, header.reading_unit, adc)
    code = voltage_v / adc.volts_per_code
    # Half a code: a voltmeter's reading is not rounded to codes.
    if adc.code_min - 0.5 <= code <= adc.code_max + 0.5:
        return voltage_v
    low, high = (end * adc.volts_per_code for end in (adc.code_min, adc.code_max))
    expected = {
        "v": f"{low:.10g} to {high:.10g} V",
        "mv": f"{low * 1000.0:.10g} to {high * 1000.0:.10g} mV",
        "code": f"{adc.code_min} to {adc.code_max}",
    }[header.reading_unit]
    remedy = _range_remedy(peak, header.reading_unit, adc)
    raise row.refuse(column, expected + ", the range of [adc]", remedy)


def _range_remedy(peak: float, reading_unit: str, adc: Adc) -> str:
    """What to do about a reading out of range, by the largest one of the file.

    A little too large is a large reading; far too large is another unit.
    """
    if volts(peak, reading_unit, adc) > 2.0 * adc.full_scale_v:
        if reading_unit == "v" and peak / 1000.0 <= adc.full_scale_v:
            return "mV taken for V? if it is in mV, name the columns ux_mv, uy_mv, uz_mv"
        if reading_unit != "code" and peak <= max(-adc.code_min, adc.code_max):
            return "if it is a code, name the columns ux_code, uy_code, uz_code"
    return "the ADC was saturated, or [adc] does not describe it"


def _deviation(row: Row, column: str, header: Header, unit: UnitDescription) -> float:
    """Standard deviation in V."""
    value = row.number(column)
    if value < 0.0:
        raise row.refuse(column, "a standard deviation, 0 or more")
    sd_v = volts(value, header.reading_unit, unit.adc)
    if sd_v > unit.adc.full_scale_v:
        raise row.refuse(column, f"less than the ADC's full scale, {unit.adc.full_scale_v:g} V")
    return sd_v


def _refuse_wrong_unit(source: str, header: Header, dwells: tuple[Dwell, ...], adc: Adc) -> None:
    """Refuse a file whose largest reading is too small to be in the unit it says."""
    peak_v = max(float(np.max(np.abs(dwell.voltage_v))) for dwell in dwells)
    if peak_v >= _SMALLEST_PEAK * adc.full_scale_v:
        return
    columns = ", ".join(READINGS[header.reading_unit])
    remedy = {
        "v": "check the unit of the readings and [adc] full_scale_v",
        "mv": "V taken for mV? if they are in V, name the columns ux_v, uy_v, uz_v",
        "code": "V taken for codes? if they are in V, name the columns ux_v, uy_v, uz_v",
    }[header.reading_unit]
    raise RefusedError(
        f"{source}, columns {columns}",
        f"the largest reading of all is {peak_v:.4g} V",
        expected=f"at least 1/500 of the ADC's full scale {adc.full_scale_v:g} V, "
        f"{_SMALLEST_PEAK * adc.full_scale_v:.4g} V",
        remedy=remedy,
    )
