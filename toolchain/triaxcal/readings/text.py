"""Text files of numbers: lines, delimiter, header and cells, with the place of each mistake."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements_csv import is_number
from triaxcal.readings.preamble import Line, find_table
from triaxcal.unit.recording import Column, RecordingLayout

_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
_BINARY = (
    (b"PK\x03\x04", "a ZIP archive or an Excel workbook"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"PAR1", "Parquet"),
    (b"\x1f\x8b", "packed by gzip"),
    (b"#ROSBAG", "a ROS bag"),
    (b"SQLite format 3", "an SQLite database, as ROS 2 writes"),
    (b"\x93NUMPY", "a NumPy array"),
)


@dataclass(frozen=True)
class TextTable:
    """Cells of a text file.

    Attributes
    ----------
    source : str
    names : tuple of str
        Of the columns; empty without a header.
    lines : list of int
        Line of the file of each row, the first line is 1.
    rows : list of lists of str
    decimal : str
    findings : tuple of str
        What was left out above the rows.
    """

    source: str
    names: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]
    decimal: str
    findings: tuple[str, ...] = ()

    def index(self, column: Column, key: str) -> int:
        """Index of a column by name or number; `key` is its key in unit.toml.

        Raises
        ------
        RefusedError
            When there is none of that name or number.
        """
        width = len(self.rows[0])
        if isinstance(column, int):
            if column <= width:
                return column - 1
            raise RefusedError(
                self.source,
                f"{width} columns",
                expected=f"column {column} ([recording] {key})",
                remedy="columns are counted from 1; check the delimiter",
            )
        lowered = [name.lower() for name in self.names]
        for names, wanted in ((list(self.names), column), (lowered, column.lower())):
            if names.count(wanted) == 1:
                return names.index(wanted)
        if column in self.names:
            raise RefusedError(
                self.source,
                f"{self.names.count(column)} columns {shown(column)} ([recording] {key})",
                expected="one of that name",
                remedy="give its number from 1",
            )
        if not self.names:
            raise RefusedError(
                self.source,
                f"no header, so no column {shown(column)} ([recording] {key})",
                expected="column numbers from 1",
                remedy="give numbers, or header = true if the first line is one",
            )
        hint = did_you_mean(column, self.names)
        raise RefusedError(
            self.source,
            f"no column {shown(column)} ([recording] {key}){hint}",
            expected="one of " + ", ".join(self.names[:20]),
        )

    def numbers(self, index: int, *, missing: bool = True) -> FloatArray:
        """Numbers of a column, shape (rows,); NaN where a cell is empty or says so.

        Raises
        ------
        RefusedError
            At the first cell that is no number; at an empty one unless `missing`.
        """
        cells = [row[index] for row in self.rows]
        if self.decimal == ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            values = np.array(cells, dtype=np.float64)
            if missing or bool(np.isfinite(values).all()):
                return np.where(np.isfinite(values), values, np.nan)
        except ValueError:
            pass
        return np.array([self._number(k, index, missing=missing) for k in range(len(cells))])

    def _number(self, row: int, index: int, *, missing: bool) -> float:
        cell = self.rows[row][index]
        text = cell.replace(",", ".") if self.decimal == "," else cell
        if is_number(text):
            return float(text)
        if missing and text.lower() in _MISSING | {"inf", "-inf", "+inf"}:
            return float("nan")
        remedy = ""
        if "," in cell and self.decimal == ".":
            remedy = 'if the decimals have a comma, decimal = ","'
        name = self.names[index] if self.names else str(index + 1)
        raise RefusedError(
            f"{self.source}, line {self.lines[row]}, column {name}",
            f"found {shown(cell)}" if cell else "the cell is empty",
            expected="a number",
            remedy=remedy,
        )


def read_text(path: Path, layout: RecordingLayout) -> TextTable:
    """Cells of a text file as its layout says; delimiter and header are found where it is silent.

    Raises
    ------
    RefusedError
        When the file cannot be read, has no rows, or a line has another number of cells.
    """
    source = str(path)
    lines = _lines(source, _decoded(path), layout)
    try:
        found = find_table(lines, layout)
    except csv.Error as error:
        raise _no_cells(source, lines) from error
    if not found.rows:
        raise RefusedError(source, "a header but no rows", expected="rows of numbers")
    _refuse_ragged(source, found.names, found.lines, found.rows)
    return TextTable(
        source, found.names, found.lines, found.rows, layout.decimal, findings=found.findings
    )


def _no_cells(source: str, lines: list[Line]) -> RefusedError:
    """What is no row of cells: a quotation mark that is not closed, a document on one line."""
    limit = csv.field_size_limit()
    line = next((line for line in lines if len(line.text) > limit), lines[0])
    return RefusedError(
        f"{source}, line {line.number}",
        f"a cell of more than {limit} characters, in a line of {len(line.text)}",
        expected="rows of numbers",
        remedy="export the recording as CSV, or remove the line",
    )


def _decoded(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RefusedError(
            str(path),
            f"cannot be read: {(error.strerror or str(error)).lower()}",
            remedy="put the recording there, or correct [recording] file",
        ) from error
    wide = _wide(data)
    if wide:
        try:
            return data.decode(wide).removeprefix("\ufeff")
        except UnicodeDecodeError as error:
            raise RefusedError(
                str(path),
                f"begins as {wide[:6].upper()} text, but byte {error.start} is none",
                expected="text in one encoding",
                remedy="save the file as UTF-8",
            ) from error
    if b"\0" in data[:4096]:
        raise RefusedError(
            str(path),
            f"a binary file{_what_binary(data)}",
            expected="text, or a MAT-file of MATLAB 5 to 7.2",
            remedy="export it as CSV",
        )
    # Latin-1 holds every byte: a degree sign in a header must not stop a file of numbers.
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _wide(data: bytes) -> str:
    """Codec of UTF-32 by its mark, of UTF-16 by it or every other byte being 0; "" of all else."""
    if data[:4] in {b"\xff\xfe\0\0", b"\0\0\xfe\xff"}:  # begins with UTF-16's mark: asked first
        return "utf-32"
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return "utf-16"
    start = data[:4096]
    even, odd = start[::2].count(0), start[1::2].count(0)
    if len(start) >= 4 and not even and odd > 0.9 * (len(start) // 2):
        return "utf-16-le"
    if len(start) >= 4 and not odd and even > 0.9 * (len(start) // 2):
        return "utf-16-be"
    return ""


def _what_binary(data: bytes) -> str:
    """What a well-known binary file is."""
    for start, name in _BINARY:
        if data.startswith(start):
            return f", {name}"
    return ""


def _lines(source: str, text: str, layout: RecordingLayout) -> list[Line]:
    found = []
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        if number <= layout.skip_rows or not line.strip():
            continue
        bare = line.lstrip()
        comment = bool(layout.comment) and bare.startswith(layout.comment)
        found.append(Line(number, bare.removeprefix(layout.comment) if comment else line, comment))
    if all(line.comment for line in found):
        raise RefusedError(
            source, "no rows", expected="rows of numbers", remedy="check skip_rows and comment"
        )
    return found


def _refuse_ragged(
    source: str, names: tuple[str, ...], lines: list[int], rows: list[list[str]]
) -> None:
    """Every row must have the cells of the first; a last line cut short is left out."""
    width = len(rows[0])
    if names and len(names) != width:
        raise RefusedError(
            f"{source}, line {lines[0]}",
            f"{width} cells under {len(names)} names",
            expected="as many cells as names",
            remedy="check delimiter, decimal and header in [recording]",
        )
    if len(rows) > 1 and len(rows[-1]) < width:
        del rows[-1], lines[-1]
    for line, row in zip(lines, rows, strict=True):
        if len(row) != width:
            raise RefusedError(
                f"{source}, line {line}",
                f"{len(row)} cells",
                expected=f"{width}, as in line {lines[0]}",
                remedy="check delimiter and decimal in [recording], or remove the line",
            )
