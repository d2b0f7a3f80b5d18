"""The columns of a recording that a table of unit.toml names, with a time, in one spool.

One reader for [recording] and [dynamic]: the file is read once, in blocks; times are repaired, rows
without all readings are left out and reported, and the rest goes into a spool of doubles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.clock import Clock
from triaxcal.readings.format import Block
from triaxcal.readings.opened import RecordingFile
from triaxcal.readings.order import Order
from triaxcal.readings.spool import Spool
from triaxcal.unit.recordingfile import ISO, ClockLayout, Column, FileLayout, SignedColumn

TIME, ROW, LABEL = "time_s", "row", "label"
GAP = 5.0
"""Of the median step: a longer step is a gap, and no pose reaches across it."""

_CODES = ("count", "code")
"""Units of raw numbers, as unit.toml names them."""


@dataclass(frozen=True)
class Quantity:
    """Columns under one key.

    Attributes
    ----------
    name : str
        What the columns are called here, as "reading".
    key : str
        Key of the table that names them, for messages.
    columns : tuple of Column
    convert : callable
        From the unit of the file, array of shape (n, columns) to the same.
    needed : bool
        Whether a row without it is left out; otherwise what is missing is 0.
    apart : bool
        Whether it may come at a rate of its own: what is missing is NaN, and a row is left out that
        has none of those that are apart.
    unit : str
        Of the values in the file, by unit.toml; "" where nothing states it.
    """

    name: str
    key: str
    columns: tuple[Column, ...]
    convert: Callable[[FloatArray], FloatArray] = lambda values: values
    needed: bool = True
    unit: str = ""
    apart: bool = False


def signed(name: str, key: str, columns: Sequence[SignedColumn], scale: float = 1.0) -> Quantity:
    """Quantity of columns with signs, times `scale`."""
    factors = np.array([column.sign * scale for column in columns])
    return Quantity(name, key, tuple(c.column for c in columns), lambda values: values * factors)


@dataclass(frozen=True)
class ReadTable:
    """Rows of a recording.

    Attributes
    ----------
    source, row_word : str
        For messages: the file, and what its rows are called.
    spool : Spool
        A row of doubles each.
    columns : mapping
        Columns of the spool by name: `TIME`, `ROW`, those of the quantities, `LABEL`.
    clocked : bool
        Whether a clock gives the times, and not a rate.
    labels : tuple of str, or None
        Text of the label that column `LABEL` numbers.
    start_s : float
        Time of the first row.
    low, high : arrays, shape (columns,)
        Extremes of all rows.
    left_out : int
        Rows left out, but for those that repeat the row before in everything.
    findings : tuple of str
    parts : tuple of (int, str)
        First row and file of each part, of several files; empty for one.
    """

    source: str
    row_word: str
    spool: Spool
    columns: Mapping[str, slice]
    clocked: bool
    labels: tuple[str, ...] | None
    start_s: float
    low: FloatArray
    high: FloatArray
    left_out: int
    findings: tuple[str, ...]
    parts: tuple[tuple[int, str], ...] = ()

    def __len__(self) -> int:
        return len(self.spool)

    def where(self, row: int) -> str:
        """Place of a row of the spool, for messages."""
        return f"{self.source}, {self.row_word} {int(self.spool.rows(row, row + 1)[0, 1])}"

    def median_step(self) -> float:
        """Median step of time, s; 1 with a single row."""
        steps = np.concatenate([np.diff(part[:, 0]) for part in self.spool.stretches()])
        return float(np.median(steps)) if len(steps) else 1.0


def read_table(
    path: Path,
    layout: FileLayout,
    clock: ClockLayout,
    quantities: Sequence[Quantity],
    label: tuple[str, Column] | None = None,
    *,
    ordered: bool = True,
    given: Mapping[str, Any] | None = None,
) -> ReadTable:
    """Rows of a file with all needed readings, in the order of time.

    Parameters
    ----------
    label : (key, column) or None
    ordered : whether times must rise
    given : columns of a program in place of the file; `path` is then only for messages

    Raises
    ------
    RefusedError
        As `RecordingFile`, `order.Order`; where half of the rows lack a reading.
    """
    file = RecordingFile(path, layout, given)
    clock = _clock_of(file, clock, quantities)
    ordered = ordered and clock.columns != ()
    reading = _Reading(file, clock, quantities, label)
    _refuse_other_units(file, quantities)
    order = Order(str(path), file.source.row_word, layout.table)
    spool = Spool(reading.width)
    low, high = np.full(reading.width, np.inf), np.full(reading.width, -np.inf)
    for rows in reading.whole_rows():
        # The last block is empty: it lets go of the rows that wait for their neighbours.
        kept = order.kept(rows, last=not len(rows)) if ordered else rows
        if len(kept):
            spool.append(kept)
            low = np.fmin(low, np.fmin.reduce(kept, axis=0))
            high = np.fmax(high, np.fmax.reduce(kept, axis=0))
    findings = (*file.source.findings, *reading.findings(), *order.findings())
    if not len(spool):
        raise RefusedError(str(path), "no row has all readings", expected="rows of numbers")
    return ReadTable(
        source=str(path),
        row_word=file.source.row_word,
        spool=spool,
        columns=reading.columns,
        clocked=clock.columns != (),
        labels=None if label is None else tuple(reading.codes),
        start_s=float(spool.rows(0, 1)[0, 0]),
        low=low,
        high=high,
        left_out=reading.missing + order.lost,
        findings=findings,
    )


def _refuse_other_units(file: RecordingFile, quantities: Sequence[Quantity]) -> None:
    """Refuse a column of which the file itself states another unit than unit.toml."""
    for quantity in quantities:
        expected, by = quantity.unit, f"{quantity.key}_unit"
        for column in quantity.columns if quantity.unit else ():
            index = file.index(column, quantity.key)
            stated = file.source.units.get(index)
            if stated is None:
                continue
            if expected in _CODES:  # of codes the file has some unit, of all axes the same one
                expected, by = stated, f"as the first of {quantity.key}"
            if stated != expected:
                raise RefusedError(
                    f"{file.path}, {file.source.names[index]}",
                    f"its unit is {shown(stated)}",
                    expected=f"{shown(expected)}, {by}",
                    remedy=f"correct {quantity.key}_unit, or the unit in the bus description",
                )


def _clock_of(
    file: RecordingFile, clock: ClockLayout, quantities: Sequence[Quantity]
) -> ClockLayout:
    """The clock that is stated, else that of the file's own format."""
    if clock.columns or clock.rate_hz is not None:
        return clock
    source, first = file.source, file.index(quantities[0].columns[0], quantities[0].key)
    own = source.clocks.get(source.tables[first]) if source.tables else None
    if own is not None:
        return replace(clock, columns=(source.names[own[0]],), units=(own[1],))
    if clock.absent is not None:
        raise clock.absent
    return clock


class _Reading:
    """Blocks of a file to rows of the spool."""

    def __init__(
        self,
        file: RecordingFile,
        clock: ClockLayout,
        quantities: Sequence[Quantity],
        label: tuple[str, Column] | None,
    ) -> None:
        self._file, self._quantities = file, quantities
        self._clock = Clock(clock, str(file.path), file.source.row_word)
        key = "time_column" if file.layout.table == "dynamic" else "time"
        stamps = [file.index(column, key) for column in clock.columns]
        dates = [unit == ISO for unit in clock.unit_of]
        self._numbers = [k for k, date in zip(stamps, dates, strict=True) if not date]
        self._texts = [k for k, date in zip(stamps, dates, strict=True) if date]
        self._stamps, self._dates = len(self._numbers), len(self._texts)
        self.columns = {TIME: slice(0, 1), ROW: slice(1, 2)}
        self.width = 2
        for quantity in quantities:
            self._numbers += [file.index(column, quantity.key) for column in quantity.columns]
            self._add(quantity.name, len(quantity.columns))
        if label is not None:
            self._texts.append(file.index(label[1], label[0]))
            self._add(LABEL, 1)
        self.codes: dict[str, int] = {}
        self.count = self.missing = self._first = 0

    def _add(self, name: str, columns: int) -> None:
        self.columns[name] = slice(self.width, self.width + columns)
        self.width += columns

    def whole_rows(self) -> Iterator[FloatArray]:
        """Rows with all needed readings of each block; an empty block at the end."""
        for block in self._file.blocks(self._numbers, self._texts):
            rows = self._rows(block)
            whole = self._whole(rows)
            self.count += len(rows)
            self.missing += int((~whole).sum())
            if not whole.all():
                self._first = self._first or int(block.rows[int(np.argmin(whole))])
            if whole.any():
                yield rows[whole]
        yield np.empty((0, self.width))

    def _whole(self, rows: FloatArray) -> BoolArray:
        finite = np.isfinite(rows)
        apart = [self.columns[q.name] for q in self._quantities if q.apart]
        if not apart:
            return np.asarray(finite.all(axis=1))
        some = np.stack([finite[:, part].all(axis=1) for part in apart], axis=1)
        for part in apart:
            finite[:, part] = True
        return np.asarray(finite.all(axis=1) & some.any(axis=1))

    def _rows(self, block: Block) -> FloatArray:
        dates, labels = block.texts[: self._dates], block.texts[self._dates :]
        seconds = self._clock.seconds(block, block.numbers[:, : self._stamps], dates)
        codes = [[self.codes.setdefault(t, len(self.codes)) for t in texts] for texts in labels]
        rows = np.column_stack([seconds, block.rows, block.numbers[:, self._stamps :], *codes])
        for quantity in self._quantities:
            part = self.columns[quantity.name]
            found = quantity.convert(rows[:, part])
            rows[:, part] = found if quantity.needed or quantity.apart else np.nan_to_num(found)
        return rows

    def findings(self) -> tuple[str, ...]:
        """What was repaired or left out; refuses a file that lacks readings in half of its rows."""
        found = self._clock.findings
        if not self.missing:
            return found
        word = self._file.source.row_word
        if self.missing > 0.5 * self.count:
            raise RefusedError(
                str(self._file.path),
                f"{self.missing} of {self.count} rows lack a reading, the first is {word} "
                f"{self._first}",
                expected="readings in most rows",
                remedy=f"check the columns in [{self._file.layout.table}]",
            )
        plural = "s" * (self.missing != 1)
        left_out = f"{self.missing} row{plural} without all readings left out"
        return (f"{left_out}, the first is {word} {self._first}", *found)
