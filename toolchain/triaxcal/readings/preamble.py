"""Where the table begins in a text file: what stands above it, which line names the columns.

Loggers write the name of the device, `sep=;`, the rate, a line of units, and some put their header
behind a comment sign. The first line of three numbers and more whose neighbours have as many cells
is a row; the header is the line above with as many cells, no number, and most of the names that
unit.toml asks for.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.readings.measurements_csv import is_number
from triaxcal.unit.recording import DELIMITERS, RecordingLayout

_SPACES = re.compile(r"[ \t]+")
_LOOKED_AT = 200
"""Lines in which the first row must be found."""
_NUMBERS_MIN = 3
_NEIGHBOURS = 3


@dataclass(frozen=True)
class Line:
    """A line that is not empty: its number from 1, its text, whether it was a comment."""

    number: int
    text: str
    comment: bool


@dataclass(frozen=True)
class FoundTable:
    """Names of the columns, cells, and their lines from 1."""

    names: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]
    findings: tuple[str, ...]


def find_table(lines: Sequence[Line], layout: RecordingLayout) -> FoundTable:
    """Rows and header of a text, with what is left open in the layout found."""
    plain = [line for line in lines if not line.comment]
    first = _first_row(plain, layout)
    delimiter = layout.delimiter or _delimiter(plain[first].text, layout.decimal)
    width = len(_trimmed(_split(plain[first].text, delimiter)))
    above = [line for line in lines if line.number < plain[first].number]
    if layout.header is None:
        header = _header(above, _wanted(layout), delimiter, width)
        if len(plain) == 1 and not any(map(_numeric, _split(plain[0].text, delimiter))):
            header = plain[0]
    else:
        header = plain[0] if layout.header else None
    names: tuple[str, ...] = ()
    after = 0
    if header is not None:
        names = _names(_split(header.text, delimiter), width)
        after = header.number
    rows: list[list[str]] = []
    numbers: list[int] = []
    skipped: list[int] = []
    for line in plain:
        cells = _split(line.text, delimiter)
        if (
            not rows
            and line is not header
            and (
                line.number < after
                or (line.number < plain[first].number and not _could_be_row(cells, width))
            )
        ):
            skipped.append(line.number)
        elif line is not header:
            rows.append(cells)
            numbers.append(line.number)
    _drop_trailing(rows, width)
    findings: tuple[str, ...] = ()
    if skipped:
        plural = "s" * (len(skipped) != 1)
        findings = (f"{len(skipped)} line{plural} above the rows left out, from {skipped[0]} on",)
    return FoundTable(names, numbers, rows, findings)


def _first_row(plain: Sequence[Line], layout: RecordingLayout) -> int:
    """Index of the first row of numbers; of the second line, or the only one, where none is."""
    for k, line in enumerate(plain[:_LOOKED_AT]):
        delimiter = layout.delimiter or _delimiter(line.text, layout.decimal)
        cells = _split(line.text, delimiter)
        if sum(map(_numeric, cells)) < _NUMBERS_MIN:
            continue
        near = plain[k + 1 : k + _NEIGHBOURS]
        if all(len(_split(other.text, delimiter)) == len(cells) for other in near):
            return k
    return 1 if len(plain) > 1 else 0


def _header(above: Sequence[Line], wanted: set[str], delimiter: str, width: int) -> Line | None:
    """Line of names above the first row; None where there is none."""
    best: tuple[int, int, Line] | None = None
    for line in above:
        cells = _trimmed(_split(line.text, delimiter))
        if any(map(_numeric, cells)) or not width - 1 <= len(cells) <= width:
            continue
        known = {cell.strip("\"' ").lower() for cell in cells}
        score = (len(wanted & known), int(not line.comment))
        if line.comment and not score[0]:
            continue  # a remark that happens to have as many words
        if best is None or score > best[:2]:
            best = (*score, line)
    if best is not None:
        return best[2]
    # A line of words just above, whatever its width: told as a header that does not fit.
    plain = [line for line in above if not line.comment]
    if not plain or any(map(_numeric, _split(plain[-1].text, delimiter))):
        return None
    return plain[-1]


def _wanted(layout: RecordingLayout) -> set[str]:
    """Names of columns that the layout asks for."""
    columns = [
        *(c.column for c in layout.acceleration),
        *(layout.gyro or ()),
        *(layout.angles.columns if layout.angles else ()),
        layout.time,
        layout.temperature,
        layout.section,
    ]
    return {column.lower() for column in columns if isinstance(column, str)}


def _names(cells: Sequence[str], width: int) -> tuple[str, ...]:
    """Names without quotation marks; the nameless first column that R writes is kept nameless."""
    names = [cell.strip().strip("\"'").strip() for cell in _trimmed(cells)]
    if len(names) == width - 1:
        names.insert(0, "")
    return tuple(names)


def _could_be_row(cells: Sequence[str], width: int) -> bool:
    """Whether a line above the first full row is a row with empty cells."""
    return len(cells) >= width and any(map(_numeric, cells))


def _numeric(cell: str) -> bool:
    return is_number(cell.replace(",", "."))


def _trimmed(cells: Sequence[str]) -> list[str]:
    """Cells without one empty cell at the end: a delimiter that closes the line."""
    return list(cells[:-1]) if len(cells) > 1 and not cells[-1].strip() else list(cells)


def _drop_trailing(rows: list[list[str]], width: int) -> None:
    """Take off the empty cell after a closing delimiter, where every row has one."""
    if rows and all(len(row) == width + 1 and not row[-1] for row in rows[:-1] or rows):
        for row in rows:
            if len(row) == width + 1:
                row.pop()


def _delimiter(line: str, decimal: str) -> str:
    """Delimiter of a line of numbers: the strongest there is, white space being the weakest."""
    for name in ("tab", "semicolon", "comma"):
        delimiter = DELIMITERS[name]
        if delimiter in line.strip() and delimiter != decimal:
            return delimiter
    return DELIMITERS["space"]


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return _SPACES.split(line.strip())
    # Line by line: a stray quotation mark must not join lines.
    return [cell.strip() for row in csv.reader([line], delimiter=delimiter) for cell in row]
