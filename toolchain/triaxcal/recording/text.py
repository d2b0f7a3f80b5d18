"""Text files of numbers: lines, delimiter, header and cells, with the place of each mistake."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.recordinglayout import DELIMITERS, Column, RecordingLayout
from triaxcal.records_csv import is_number
from triaxcal.tomltable import did_you_mean, shown

_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
_SPACES = re.compile(r"[ \t]+")


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
    """

    source: str
    names: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]
    decimal: str

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
    """Cells of a text file as its layout says; a delimiter or header left open is found.

    Raises
    ------
    RefusedError
        When the file cannot be read, has no rows, or a line has another number of cells.
    """
    source = str(path)
    kept = _kept_lines(source, _decoded(path), layout)
    first = kept[0][1]
    second = kept[1][1] if len(kept) > 1 else first
    delimiter = layout.delimiter or _delimiter(second, layout.decimal)
    cells = _split([text for _, text in kept], delimiter)
    lines = [number for number, _ in kept]
    header = layout.header
    if header is None:
        header = not any(is_number(c.replace(",", ".")) for c in cells[0])
    names: tuple[str, ...] = ()
    if header:
        names = tuple(cell.strip().strip("\"'").strip() for cell in cells[0])
        cells, lines = cells[1:], lines[1:]
    if not cells:
        raise RefusedError(source, "a header but no rows", expected="rows of numbers")
    _refuse_ragged(source, names, lines, cells)
    return TextTable(source, names, lines, cells, layout.decimal)


def _decoded(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RefusedError(
            str(path),
            f"cannot be read: {(error.strerror or str(error)).lower()}",
            remedy="put the recording there, or correct [recording] file",
        ) from error
    if b"\0" in data[:4096]:
        raise RefusedError(
            str(path), "a binary file", expected="text, or a MAT-file of MATLAB 5 to 7.2"
        )
    # Latin-1 holds every byte: a degree sign in a header must not stop a file of numbers.
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _kept_lines(source: str, text: str, layout: RecordingLayout) -> list[tuple[int, str]]:
    kept = []
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        if number <= layout.skip_rows or not line.strip():
            continue
        if layout.comment and line.lstrip().startswith(layout.comment):
            continue
        kept.append((number, line))
    if not kept:
        raise RefusedError(
            source, "no rows", expected="rows of numbers", remedy="check skip_rows and comment"
        )
    return kept


def _delimiter(line: str, decimal: str) -> str:
    """Delimiter of a line of numbers: the strongest there is, white space being the weakest."""
    for name in ("tab", "semicolon", "comma"):
        delimiter = DELIMITERS[name]
        if delimiter in line and delimiter != decimal:
            return delimiter
    return DELIMITERS["space"]


def _split(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    if delimiter == " ":
        return [_SPACES.split(line.strip()) for line in lines]
    # Line by line: a stray quotation mark must not join lines.
    return [
        [cell.strip() for cell in row]
        for line in lines
        for row in csv.reader([line], delimiter=delimiter)
    ]


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
