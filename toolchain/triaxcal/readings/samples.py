"""[recording]: the rows of its file as samples, and what is wrong with them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.readings.joined import joined
from triaxcal.readings.table import GAP, LABEL, ROW, TIME, Quantity, ReadTable, read_table, signed
from triaxcal.readings.units import to_degc, to_radians
from triaxcal.unit.recording import SAMPLES, RecordingLayout
from triaxcal.unit.recordingfile import ISO, TIME_UNITS, files_in
from triaxcal.unit.thermometer import TemperatureSensor

READING, GYRO, TEMP, ANGLES = "reading", "gyro", "temp_degc", "angles_rad"
_WIDE = frozenset({READING, GYRO, ANGLES})
_SLOW_S = 1.0
"""Between samples: slower than any logger of poses, and milliseconds taken for seconds look so."""


@dataclass(frozen=True)
class Samples:
    """Samples of a recording, or its poses where each row is one; they stay in the spool.

    Columns are asked for by name: `TIME` (s, from the first sample), `ROW` of the file, `READING`
    (x, y, z in the unit of the layout), `GYRO` (any unit: it only shows stillness and handedness),
    `TEMP` (degC), `ANGLES` (in the order of `ANGLE_NAMES`, or the directions) and `LABEL`.

    Attributes
    ----------
    table : ReadTable
    step_s : float
        Median time step.
    findings : tuple of str
        What was left out, and where.
    """

    table: ReadTable
    step_s: float
    findings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.table.spool)

    def __contains__(self, name: str) -> bool:
        return name in self.table.columns

    @property
    def source(self) -> str:
        """File, for messages."""
        return self.table.source

    def cut(self, rows: FloatArray, name: str) -> FloatArray:
        """Columns of rows of the spool: readings, gyro and angles (n, columns), all else (n,)."""
        found = rows[:, self.table.columns[name]]
        found = found if name in _WIDE else found[:, 0]
        return np.ascontiguousarray(found - self.table.start_s if name == TIME else found)

    def part(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Columns of the samples from `start` to `stop`, stop excluded, in memory."""
        return self.cut(self.table.spool.rows(start, len(self) if stop is None else stop), name)

    def pieces(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Index of the first sample, and the rows, of each piece; `cut` gives their columns."""
        return self.table.spool.pieces(start, stop)

    def one(self, name: str, index: int) -> float:
        """Value of a column that is one, at a sample."""
        return float(self.part(name, index, index + 1)[0])

    def label(self, index: int) -> str:
        """Text of the section of a sample; "" without a section column."""
        return self.table.labels[int(self.one(LABEL, index))] if self.table.labels else ""

    def place(self, index: int) -> str:
        """File and line (or row) of a sample, for messages."""
        file = self.file(index) or self.source
        return f"{file}, {self.table.row_word} {self.one(ROW, index):.0f}"

    def file(self, index: int) -> str:
        """File of a sample, of several; "" where there is one."""
        starts = [start for start, _ in self.table.parts]
        return self.table.parts[bisect_right(starts, index) - 1][1] if starts else ""

    def extremes(self, name: str) -> FloatArray:
        """Lowest and highest values of all samples, shape (2, columns)."""
        part = self.table.columns[name]
        return np.stack([self.table.low[part], self.table.high[part]])

    def total(self, name: str, start: int, stop: int) -> FloatArray:
        """Sum of samples, shape (columns,) or ()."""
        return np.asarray(
            sum(self.cut(rows, name).sum(axis=0) for _, rows in self.pieces(start, stop))
        )

    def mean(self, name: str, start: int, stop: int) -> FloatArray:
        """Mean of samples, shape (columns,) or ()."""
        return np.asarray(self.total(name, start, stop) / (stop - start))

    def deviation(self, name: str, start: int, stop: int) -> FloatArray:
        """Standard deviation of samples about their mean, shape (columns,)."""
        mean = self.mean(name, start, stop)
        parts = (self.cut(rows, name) - mean for _, rows in self.pieces(start, stop))
        return np.asarray(
            np.sqrt(sum((part * part).sum(axis=0) for part in parts) / (stop - start))
        )

    def first_from(self, time_s: float) -> int:
        """Index of the first sample at `time_s` or later."""
        return bisect_left(range(len(self)), time_s, key=lambda k: self.one(TIME, k))

    def runs(self) -> list[tuple[int, int]]:
        """Start and stop, stop excluded, of each stretch of samples with one label in one file."""
        starts = [0, *(start for start, _ in self.table.parts[1:])]
        before = self.one(LABEL, 0)
        for first, rows in self.pieces():
            codes = self.cut(rows, LABEL)
            changes = np.flatnonzero(np.diff(codes, prepend=before))
            starts += (first + changes).tolist()
            before = codes[-1]
        starts = sorted(set(starts))
        return list(zip(starts, [*starts[1:], len(self)], strict=True))


def read_samples(
    folder: Path,
    layout: RecordingLayout,
    sensor: TemperatureSensor,
    given: Mapping[str, Any] | None = None,
) -> Samples:
    """Samples of the file of a layout, or of the columns that a program gives in its place.

    Raises
    ------
    RefusedError
        As `read_table`; for temperatures that cannot be.
    """
    reading = signed(READING, "acceleration", layout.acceleration)
    quantities = [replace(reading, unit=layout.acceleration_unit)]
    if layout.gyro:
        quantities.append(Quantity(GYRO, "gyro", layout.gyro, needed=False))
    if layout.temperature is not None:
        degc = to_degc(layout.temperature_unit, sensor)
        unit = layout.temperature_unit
        quantities.append(Quantity(TEMP, "temperature", (layout.temperature,), degc, unit=unit))
    if layout.angles is not None:
        key, convert = "the angles", to_radians(layout.angles.unit)
        if layout.direction is not None:
            key, convert = "direction", to_radians("rad")  # as they are: `pose_angles` turns them
        quantities.append(Quantity(ANGLES, key, layout.angles.columns, convert))
    label = None if layout.section is None else ("section", layout.section)
    clock = layout.clock
    if layout.rows == SAMPLES and not layout.faces:
        place = f"{folder / 'unit.toml'}, [{layout.table}] time"
        absent = RefusedError(place, "missing", expected="a time column, or sample_rate_hz")
        clock = replace(clock, absent=absent)
    ordered = layout.rows == SAMPLES
    paths = files_in(folder, layout.file) if given is None else (Path("readings"),)

    def read(path: Path) -> ReadTable:
        table = read_table(
            path, layout.written, clock, quantities, label, ordered=ordered, given=given
        )
        if len(paths) > 1:
            table.spool.to_file()
        return table

    table = joined([read(path) for path in paths]) if len(paths) > 1 else read(paths[0])
    samples = Samples(table, table.median_step(), table.findings)
    if TEMP in samples:
        _refuse_implausible(samples, layout.table)
    if not (ordered and table.clocked):
        return samples
    return Samples(
        table, samples.step_s, (*table.findings, *_slow_clock(samples, layout), *_gaps(samples))
    )


def _slow_clock(samples: Samples, layout: RecordingLayout) -> tuple[str, ...]:
    if samples.step_s < _SLOW_S or not layout.time or ISO in layout.time_unit:
        return ()
    unit = f'time_unit = "{", ".join(layout.time_unit)}"'
    scale = TIME_UNITS[layout.time_unit[0]]
    near = [u for u, s in TIME_UNITS.items() if s < scale and s / scale * samples.step_s < _SLOW_S]
    like = f', as time_unit = "{near[0]}"' if near and len(layout.time) == 1 else ""
    return (f"{unit} gives a sample every {samples.step_s:.4g} s: correct it if wrong{like}",)


def _gaps(samples: Samples) -> tuple[str, ...]:
    count, longest, after = 0, 0.0, 0
    before = 0.0
    for first, rows in samples.pieces():
        steps = np.diff(samples.cut(rows, TIME), prepend=before)
        gap = steps > GAP * samples.step_s
        joints = np.array([start for start, _ in samples.table.parts], dtype=np.int64) - first
        gap[joints[(joints >= 0) & (joints < len(gap))]] = False
        steps = np.where(gap, steps, 0.0)
        gaps = np.flatnonzero(gap)
        count += len(gaps)
        if len(gaps) and steps.max() > longest:
            longest, after = float(steps.max()), first + int(steps.argmax())
        before = samples.cut(rows[-1:], TIME)[0]
    if not count:
        return ()
    place = f"{samples.table.row_word} {samples.one(ROW, after):.0f}"
    found = f"{count} gap{'s' * (count != 1)} in time, the longest {longest:.3g} s before {place}"
    return (f"{found}; no pose extends across a gap",)


def _refuse_implausible(samples: Samples, table: str) -> None:
    low, high = PLAUSIBLE_DEGC
    coldest, warmest = samples.extremes(TEMP)[:, 0]
    if not (low <= coldest and warmest <= high):
        raise RefusedError(
            samples.source,
            f"temperatures of {coldest:.4g} to {warmest:.4g} degC",
            expected=f"{low:g} to {high:g} degC",
            remedy=f"check temperature and temperature_unit in [{table}]",
        )
