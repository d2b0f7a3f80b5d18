"""A recording's file to samples: columns by the layout, time in seconds, and what is wrong."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.text import TextTable, read_text
from triaxcal.unit.description import TemperatureSensor
from triaxcal.unit.recording import SAMPLES, TIME_UNITS, Column, RecordingLayout

GAP = 5.0
"""Of the median step: a longer step is a gap, and no pose reaches across it."""
_TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d:\d\d([.,]\d+)?")
_SLOW_S = 1.0
"""Between samples: slower than any logger of poses, and milliseconds taken for seconds look so."""
_REPEATS_MAX = 0.01
"""Of the rows: repeated rows beyond this are a clock too coarse, not a logger's hiccup."""


@dataclass(frozen=True)
class Samples:
    """Samples of a recording, or its poses where each row is one.

    Attributes
    ----------
    source : str
    time_s : array, shape (n,)
        From the first sample.
    reading : array, shape (n, 3)
        Outputs x, y, z in the unit of the layout.
    gyro : array, shape (n, 3), or None
        In any unit: it only shows stillness and handedness.
    temp_degc : array, shape (n,), or None
    angles_rad : array, shape (n, 2 or 3), or None
        In the order of `recordinglayout.ANGLE_NAMES`.
    label : tuple of str, or None
    line : array, shape (n,)
        Line of the file, from 1 (row of the matrix for a MAT-file).
    step_s : float
        Median time step.
    findings : tuple of str
        What was left out, and where.
    """

    source: str
    time_s: FloatArray
    reading: FloatArray
    gyro: FloatArray | None
    temp_degc: FloatArray | None
    angles_rad: FloatArray | None
    label: tuple[str, ...] | None
    line: IntArray
    step_s: float
    findings: tuple[str, ...]

    @property
    def gaps(self) -> IntArray:
        """Indices of the samples after a gap."""
        return np.flatnonzero(np.diff(self.time_s) > GAP * self.step_s) + 1


def read_samples(folder: Path, layout: RecordingLayout, sensor: TemperatureSensor) -> Samples:
    """Samples of the file of a layout.

    Raises
    ------
    RefusedError
        When the file cannot be read, is not as the layout says, or its time runs back or stands.
    """
    path = folder / layout.file
    columns = _Columns.of(path, layout)
    reading = np.stack(
        [c.sign * columns.numbers(c.column, "acceleration") for c in layout.acceleration], axis=1
    )
    time, clock = columns.time(layout)
    gyro = (
        np.stack([columns.numbers(c, "gyro") for c in layout.gyro], axis=1) if layout.gyro else None
    )
    temp = None
    if layout.temperature is not None:
        temp = _degc(columns.numbers(layout.temperature, "temperature"), layout, sensor)
    angles = None
    if layout.angles is not None:
        angles = np.stack(
            [columns.numbers(c, "the angles") for c in layout.angles.columns], axis=1
        ) * (np.pi / 180.0 if layout.angles.unit == "deg" else 1.0)
    label = columns.labels(layout.section) if layout.section is not None else None
    whole = _complete(reading, time, temp, angles)
    findings = [] if columns.table is None else list(columns.table.findings)
    if not whole.all():
        missing = np.flatnonzero(~whole)
        if len(missing) > 0.5 * len(whole):
            raise RefusedError(
                str(path),
                f"{len(missing)} of {len(whole)} rows lack a reading, the first is line "
                f"{columns.line[missing[0]]}",
                expected="readings in most rows",
                remedy="check the columns in [recording]",
            )
        findings.append(
            f"{len(missing)} row{'s' * (len(missing) != 1)} without all readings left out, the "
            f"first is line {columns.line[missing[0]]}"
        )
    whole, repeated = _without_repeats(whole, time, reading, layout, columns)
    if repeated:
        findings.append(repeated)
    time = time[whole]
    if len(time) == 0:
        raise RefusedError(str(path), "no row has all readings", expected="rows of numbers")
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    samples = Samples(
        source=str(path),
        time_s=time - time[0],
        reading=reading[whole],
        gyro=None if gyro is None else np.nan_to_num(gyro[whole]),
        temp_degc=None if temp is None else temp[whole],
        angles_rad=None if angles is None else angles[whole],
        label=None if label is None else tuple(np.array(label)[whole].tolist()),
        line=columns.line[whole],
        step_s=step,
        findings=tuple(findings),
    )
    if not clock or layout.rows != SAMPLES:
        return samples
    return _with_gaps(_with_slow_clock(samples, layout))


@dataclass(frozen=True)
class _Columns:
    """Columns of a text or MAT-file, by one way of asking."""

    source: str
    numbers: Callable[[Column, str], FloatArray]
    line: IntArray
    table: TextTable | None

    @staticmethod
    def of(path: Path, layout: RecordingLayout) -> _Columns:
        from triaxcal.readings.mat import MatTable, is_mat_file  # noqa: PLC0415  scipy.io is slow

        if is_mat_file(path):
            mat = MatTable(path, layout.variable)
            first = layout.acceleration[0].column
            count = len(mat.numbers(first, "acceleration"))

            def numbers(column: Column, key: str) -> FloatArray:
                found = mat.numbers(column, key)
                if len(found) != count:
                    raise RefusedError(
                        str(path),
                        f"{len(found)} values in {column} ([recording] {key}), {count} in {first}",
                        expected="one value a sample in each",
                        remedy="give columns that belong together, or save them at one rate",
                    )
                return found

            return _Columns(str(path), numbers, np.arange(1, count + 1), None)
        table = read_text(path, layout)
        return _Columns(
            str(path),
            lambda column, key: table.numbers(table.index(column, key)),
            np.array(table.lines, dtype=np.int64),
            table,
        )

    def labels(self, column: Column) -> list[str]:
        """Text of the section column."""
        if self.table is None:
            values = self.numbers(column, "section")
            return [f"{value:g}" for value in values]
        index = self.table.index(column, "section")
        return [row[index] for row in self.table.rows]

    def time(self, layout: RecordingLayout) -> tuple[FloatArray, bool]:
        """Time in seconds, and whether a clock told it."""
        count = len(self.line)
        if layout.time is None:
            return np.arange(count) / (layout.sample_rate_hz or 1.0), False
        if layout.time_unit != "iso":
            values = self.numbers(layout.time, "time")
            # The first value is taken off before scaling: microseconds of years need all digits.
            start = values[np.isfinite(values)][:1]
            return (values - (start[0] if len(start) else 0.0)) * TIME_UNITS[layout.time_unit], True
        if self.table is None:
            raise RefusedError(self.source, 'time_unit = "iso" in a MAT-file', expected="numbers")
        return self._iso(self.table, layout.time), True

    def _iso(self, table: TextTable, column: Column) -> FloatArray:
        index = table.index(column, "time")
        seconds = np.empty(len(table.rows))
        start: datetime.datetime | None = None
        for k, row in enumerate(table.rows):
            try:
                moment = _moment(row[index].strip("\"' "))
                start = start or moment
                seconds[k] = (moment - start).total_seconds()
            except (ValueError, TypeError) as error:
                raise RefusedError(
                    f"{table.source}, line {table.lines[k]}",
                    f"found {row[index]!r}",
                    expected="a date and time, as 2026-03-30T12:00:00.25, or a time of day",
                ) from error
        return seconds


def _moment(text: str) -> datetime.datetime:
    """Moment of ISO 8601, with slashes for dashes, or of a day without a date."""
    if _TIME_OF_DAY.fullmatch(text):
        hours, rest = text.split(":", 1)
        return datetime.datetime.fromisoformat(f"2000-01-01T{hours.zfill(2)}:{rest}")
    return datetime.datetime.fromisoformat(text.replace("/", "-"))


def _complete(
    reading: FloatArray, time: FloatArray, temp: FloatArray | None, angles: FloatArray | None
) -> BoolArray:
    whole = np.isfinite(reading).all(axis=1) & np.isfinite(time)
    if temp is not None:
        whole &= np.isfinite(temp)
    if angles is not None:
        whole &= np.isfinite(angles).all(axis=1)
    return whole


def _without_repeats(
    whole: BoolArray,
    time: FloatArray,
    reading: FloatArray,
    layout: RecordingLayout,
    columns: _Columns,
) -> tuple[BoolArray, str]:
    """Rows with time and readings of the one before left out; time running back is refused."""
    if layout.time is None or layout.rows != SAMPLES:
        return whole, ""
    index = np.flatnonzero(whole)
    step = np.diff(time[index])
    back = np.flatnonzero(step < 0.0)
    if len(back):
        line = columns.line[index[back[0] + 1]]
        raise RefusedError(
            f"{columns.source}, line {line}",
            f"time runs back by {-step[back[0]]:.6g} s",
            expected="rising time",
            remedy="cut the recording there, or correct time and time_unit in [recording]",
        )
    still = np.flatnonzero(step == 0.0)
    if len(still) > _REPEATS_MAX * len(index):
        line = columns.line[index[still[0] + 1]]
        raise RefusedError(
            f"{columns.source}, line {line}",
            f"{len(still)} of {len(index)} rows repeat the time of the row before",
            expected="a time of its own for each row",
            remedy="if the clock is coarser than the readings, leave out time and give "
            "sample_rate_hz; if rows are doubled, remove them",
        )
    if not len(still):
        return whole, ""
    kept = whole.copy()
    kept[index[still + 1]] = False
    same = int((reading[index[still + 1]] == reading[index[still]]).all(axis=1).sum())
    return kept, (
        f"{len(still)} row{'s' * (len(still) != 1)} with the time of the row before left out "
        f"({same} of them the same in all), the first is line {columns.line[index[still[0] + 1]]}"
    )


def _with_slow_clock(samples: Samples, layout: RecordingLayout) -> Samples:
    if samples.step_s < _SLOW_S or layout.time_unit == "iso":
        return samples
    told = (
        f'a sample every {samples.step_s:.4g} s by time_unit = "{layout.time_unit}": if that is '
        "not so, correct it"
    )
    return replace(samples, findings=(*samples.findings, told))


def _with_gaps(samples: Samples) -> Samples:
    gaps = samples.gaps
    if not len(gaps):
        return samples
    length = np.diff(samples.time_s)[gaps - 1]
    longest = gaps[int(length.argmax())]
    told = (
        f"{len(gaps)} gap{'s' * (len(gaps) != 1)} in time, the longest {length.max():.3g} s before "
        f"line {samples.line[longest]}; no pose reaches across one"
    )
    return replace(samples, findings=(*samples.findings, told))


def _degc(values: FloatArray, layout: RecordingLayout, sensor: TemperatureSensor) -> FloatArray:
    unit = layout.temperature_unit
    if unit == "K":
        degc = values - 273.15
    elif unit == "degF":
        degc = (values - 32.0) / 1.8
    else:
        degc = sensor.degc_at_zero + values * sensor.degc_per_code if unit == "code" else values
    low, high = PLAUSIBLE_DEGC
    finite = degc[np.isfinite(degc)]
    if len(finite) and not (low <= finite.min() and finite.max() <= high):
        raise RefusedError(
            layout.file,
            f"temperatures of {finite.min():.4g} to {finite.max():.4g} degC",
            expected=f"{low:g} to {high:g} degC",
            remedy="check temperature and temperature_unit in [recording]",
        )
    return degc
