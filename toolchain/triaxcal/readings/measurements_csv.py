"""Cells, columns and lines of measurements.csv: text to numbers, with the place of each mistake."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.durable import replace_file
from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.readings.numbertext import is_number, number_remedy

READING_UNITS = ("v", "mv", "code")
TEMPERATURE_UNITS = ("degc", "code")
READINGS = {unit: tuple(f"u{axis}_{unit}" for axis in "xyz") for unit in READING_UNITS}
DEVIATIONS = {unit: tuple(f"sd_u{axis}_{unit}" for axis in "xyz") for unit in READING_UNITS}
_KNOWN = (
    "position",
    *(f"temp_{unit}" for unit in TEMPERATURE_UNITS),
    *(name for unit in READING_UNITS for name in READINGS[unit]),
    "count",
    *(name for unit in READING_UNITS for name in DEVIATIONS[unit]),
)


@dataclass(frozen=True)
class Header:
    """Columns of a file, and the units that they are in.

    Attributes
    ----------
    columns : tuple of str
        Names in the order of the file.
    reading_unit : str
        "v", "mv" or "code", of readings and deviations alike.
    temperature_unit : str
        "degc" or "code".
    """

    columns: tuple[str, ...]
    reading_unit: str
    temperature_unit: str

    @property
    def has_count(self) -> bool:
        """Whether each dwell says how many readings it has."""
        return "count" in self.columns

    @property
    def has_deviations(self) -> bool:
        """Whether each dwell says the standard deviation of its readings."""
        return DEVIATIONS[self.reading_unit][0] in self.columns


@dataclass(frozen=True)
class Row:
    """Cells of one line by column; getters report file, line and column of a mistake."""

    source: str
    line: int
    cells: dict[str, str]

    def where(self, column: str) -> str:
        """Place of a cell as messages name it."""
        return f"{self.source}, row {self.line}, column {column}"

    def refuse(self, column: str, expected: str, remedy: str = "") -> RefusedError:
        """Error that names a cell's text and what should be there."""
        text = self.cells[column]
        found = f"found {shown(text)}" if text else "the cell is empty"
        return RefusedError(self.where(column), found, expected=expected, remedy=remedy)

    def number(self, column: str) -> float:
        """Finite decimal number.

        Raises
        ------
        RefusedError
            For anything else; the remedy names a decimal comma or a thousands separator.
        """
        text = self.cells[column]
        if is_number(text):
            return float(text)
        raise self.refuse(column, "a number such as -0.54859", number_remedy(text))

    def whole(self, column: str, low: int, high: int) -> int:
        """Whole number from `low` to `high`."""
        value = self.number(column)
        if not value.is_integer() or not low <= value <= high:
            raise self.refuse(column, f"a whole number from {low} to {high}")
        return int(value)


def read_rows(path: Path) -> tuple[Header, list[Row]]:
    """Header and rows of a file; blank lines and the comments above the header are left out.

    Raises
    ------
    RefusedError
        When the file cannot be read, is not UTF-8, has wrong columns, a line with too few or too
        many cells, or no rows.
    """
    source = str(path)
    records = _records(source, _text(path))
    first = next(records, None)
    if first is None:
        raise RefusedError(source, "no header and no rows", expected="a header and rows")
    columns = tuple(cell.strip() for cell in first[1])
    header = _header(f"{source}, row {first[0]} (header)", columns)
    rows = [Row(source, line, _cells(source, line, cells, columns)) for line, cells in records]
    if not rows:
        raise RefusedError(source, "a header but no rows", expected="one row for each dwell")
    return header, rows


def rows_of(columns: Mapping[str, Any]) -> tuple[Header, list[Row]]:
    """Header and rows of columns by name, as `read_rows` finds them in a file.

    Raises
    ------
    RefusedError
        For wrong columns, columns of different lengths, or none.
    """
    names = tuple(str(name).strip() for name in columns)
    header = _header("readings, columns", names)
    for name in columns:
        if np.ma.is_masked(columns[name]):
            raise RefusedError(
                f"readings, column {name}",
                "found masked values",
                expected="a number in each row",
                remedy="leave out the rows that are masked",
            )
    cells = {
        name: [_cell(v) for v in np.atleast_1d(np.asarray(columns[c])).tolist()]
        for name, c in zip(names, columns, strict=True)
    }
    lengths = {name: len(values) for name, values in cells.items()}
    if len(set(lengths.values())) != 1 or not min(lengths.values()):
        raise RefusedError(
            "readings",
            "columns of " + ", ".join(f"{n} ({name})" for name, n in lengths.items()) + " rows",
            expected="one length for all, at least 1",
        )
    rows = zip(*cells.values(), strict=True)
    return header, [
        Row("readings", number, dict(zip(names, row, strict=True)))
        for number, row in enumerate(rows, start=1)
    ]


def _cell(value: object) -> str:
    """A value as a file has it: repr of a float reads back to the same float."""
    return repr(value) if isinstance(value, float) else str(value)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        remedy = "put the dwells there, as docs/how-to/add-a-unit.md describes"
        raise refused_by_system(path, "read", error, remedy=remedy) from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RefusedError(
            f"{path}, row {line}", "not UTF-8", remedy="save the file as CSV UTF-8"
        ) from error


def _records(source: str, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of the header and every row."""
    lines = re.split(r"\r\n|\n|\r", text)
    comments = 0
    while comments < len(lines) and (
        not lines[comments].strip() or lines[comments].lstrip().startswith("#")
    ):
        comments += 1
    # Quotes are kept within a line: a cell with a line break in it is a mistake here.
    for number, line in enumerate(lines[comments:], start=comments + 1):
        if not line.strip():
            continue
        try:
            yield number, next(csv.reader([line], skipinitialspace=True, strict=True))
        except csv.Error as error:
            raise RefusedError(f"{source}, row {number}", f"not CSV: {error}") from error


def _cells(source: str, line: int, cells: list[str], columns: tuple[str, ...]) -> dict[str, str]:
    if len(cells) == len(columns):
        return {column: cell.strip() for column, cell in zip(columns, cells, strict=True)}
    if cells[0].lstrip().startswith("#"):
        remedy = "comments go above the header"
    elif len(cells) > len(columns):
        remedy = "a decimal comma or a thousands separator cuts a number in two: leave it out"
    elif ";" in cells[0]:
        remedy = "separate the cells with commas, not semicolons"
    else:
        remedy = ""
    raise RefusedError(
        f"{source}, row {line}",
        f"{len(cells)} cell{'s' if len(cells) > 1 else ''}",
        expected=f"{len(columns)}, as in the header",
        remedy=remedy,
    )


def _header(where: str, columns: tuple[str, ...]) -> Header:
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(columns) == 1 and separator in columns[0]:
            raise RefusedError(where, f"cells separated by {name}", expected="commas")
    doubled = sorted({column for column in columns if columns.count(column) > 1})
    if doubled:
        raise RefusedError(where, "doubled column: " + ", ".join(shown(c) for c in doubled))
    unknown = [column for column in columns if column not in _KNOWN]
    readings = _one_unit(where, columns, READINGS)
    temperatures = [u for u in TEMPERATURE_UNITS if f"temp_{u}" in columns]
    missing = [] if "position" in columns else ["position"]
    missing += [] if temperatures else ["temp_degc (or temp_code)"]
    missing += [c for c in READINGS[readings or "v"] if c not in columns]
    deviations = _one_unit(where, columns, DEVIATIONS)
    missing += [c for c in DEVIATIONS[deviations] if c not in columns] if deviations else []
    if missing or unknown:
        parts = ["missing column: " + ", ".join(missing)] if missing else []
        if unknown:
            hints = [
                (shown(c) if c else "an empty name") + did_you_mean(c, _KNOWN) for c in unknown
            ]
            parts.append("unknown column: " + ", ".join(hints))
        raise RefusedError(
            where, "; ".join(parts), remedy="columns: see docs/reference/file-formats.md"
        )
    _check_together(where, columns, readings, deviations)
    return Header(columns, readings, temperatures[0])


def _one_unit(where: str, columns: tuple[str, ...], names: dict[str, tuple[str, ...]]) -> str:
    """Unit of a group of columns, "" when there is none."""
    found = [c for unit_names in names.values() for c in unit_names if c in columns]
    units = {c.rpartition("_")[2] for c in found}
    if len(units) > 1:
        raise RefusedError(
            where, "columns in different units: " + ", ".join(found), expected="one unit for all"
        )
    return units.pop() if units else ""


def _check_together(where: str, columns: tuple[str, ...], readings: str, deviations: str) -> None:
    """Refuse columns that are each legal, but not together."""
    if "temp_degc" in columns and "temp_code" in columns:
        raise RefusedError(where, "both temp_degc and temp_code", expected="one of them")
    if deviations and deviations != readings:
        raise RefusedError(
            where,
            f"{DEVIATIONS[deviations][0]} beside {READINGS[readings][0]}",
            expected=f"deviations in the unit of the readings, {DEVIATIONS[readings][0]}",
        )
    if deviations and "count" not in columns:
        raise RefusedError(
            where, "standard deviations without count", expected="the column count beside them"
        )


def measurements_text(
    columns: Sequence[str],
    rows: Iterable[Sequence[str | int | float]],
    comments: Sequence[str] = (),
) -> str:
    """Text of a measurements.csv.

    Floats are written with the fewest digits that read back to the same float.
    """
    lines = [f"# {comment}" for comment in comments] + [",".join(columns)]
    return "\n".join([*lines, *(",".join(map(_cell, row)) for row in rows)]) + "\n"


def write_measurements(
    path: Path,
    columns: Sequence[str],
    rows: Iterable[Sequence[str | int | float]],
    comments: Sequence[str] = (),
) -> None:
    """Write a measurements.csv, as `measurements_text`, in one step.

    Raises
    ------
    RefusedError
        When the folder cannot be written.
    """
    text = measurements_text(columns, rows, comments)
    try:
        replace_file(path, text.encode())
    except OSError as error:
        raise refused_by_system(path, "written", error) from error
