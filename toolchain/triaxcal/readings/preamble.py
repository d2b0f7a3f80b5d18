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

from triaxcal.readings.numbertext import is_number
from triaxcal.unit.recordingfile import DELIMITERS, FileLayout

_SPACES = re.compile(r"[ \t]+")
LOOKED_AT = 200
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
    """Where the rows begin and how their cells are separated.

    Attributes
    ----------
    names : tuple of str
        Of the columns; empty without a header.
    start : int
        Line of the first row, from 1; 0 if there is none.
    delimiter : str
    width : int
        Cells of a row.
    closed : bool
        Whether a delimiter may close the line.
    findings : tuple of str
        What was left out above the rows.
    """

    names: tuple[str, ...]
    start: int
    delimiter: str
    width: int
    closed: bool
    findings: tuple[str, ...]


def find_table(lines: Sequence[Line], layout: FileLayout) -> FoundTable:
    """Rows and header from the first lines of a text, with what is left open in the layout found.

    Parameters
    ----------
    lines : sequence of Line
        Of them `LOOKED_AT` and more that are no comment, where the text has as many.
    """
    plain = [line for line in lines if not line.comment]
    first = _first_row(plain, layout)
    delimiter = layout.delimiter or _delimiter(plain[first].text, layout.decimal)
    cells = split_cells(plain[first].text, delimiter)
    width = len(_trimmed(cells))
    above = [line for line in lines if line.number < plain[first].number]
    if layout.header is None:
        wanted = {str(column).lower() for column in layout.wanted}
        header = _header(above, wanted, delimiter, width)
        if len(plain) == 1 and not any(map(_numeric, cells)):
            header = plain[0]
    else:
        header = plain[0] if layout.header else None
    names = () if header is None else _names(split_cells(header.text, delimiter), width)
    if len(names) == len(cells):
        width = len(cells)  # the last cell of the first row is empty: no delimiter closes it
    after = 0 if header is None else header.number
    skipped: list[int] = []
    start = 0
    for line in plain:
        if line is header:
            continue
        could_be = _could_be_row(split_cells(line.text, delimiter), width)
        if line.number >= after and (line.number >= plain[first].number or could_be):
            start = line.number
            break
        skipped.append(line.number)
    findings: tuple[str, ...] = ()
    if skipped:
        plural = "s" * (len(skipped) != 1)
        findings = (
            f"{len(skipped)} line{plural} left out above the rows, from line {skipped[0]} on",
        )
    return FoundTable(names, start, delimiter, width, len(cells) > width, findings)


def _first_row(plain: Sequence[Line], layout: FileLayout) -> int:
    """Index of the first row of numbers; of the second line, or the only one, where none is."""
    for k, line in enumerate(plain[:LOOKED_AT]):
        delimiter = layout.delimiter or _delimiter(line.text, layout.decimal)
        cells = split_cells(line.text, delimiter)
        if sum(map(_numeric, cells)) < _NUMBERS_MIN:
            continue
        near = plain[k + 1 : k + _NEIGHBOURS]
        if all(len(split_cells(other.text, delimiter)) == len(cells) for other in near):
            return k
    return 1 if len(plain) > 1 else 0


def _header(above: Sequence[Line], wanted: set[str], delimiter: str, width: int) -> Line | None:
    """Line of names above the first row; None if there is none."""
    best: tuple[int, int, Line] | None = None
    for line in above:
        cells = _trimmed(split_cells(line.text, delimiter))
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
    # A line of words just above, whatever its width: reported as a header that does not fit.
    plain = [line for line in above if not line.comment]
    if not plain or any(map(_numeric, split_cells(plain[-1].text, delimiter))):
        return None
    return plain[-1]


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


def _delimiter(line: str, decimal: str) -> str:
    """Delimiter of a line of numbers: the strongest there is, white space being the weakest."""
    for name in ("tab", "pipe", "semicolon", "comma"):
        delimiter = DELIMITERS[name]
        if delimiter in line.strip() and delimiter != decimal:
            return delimiter
    return DELIMITERS["space"]


def split_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without the white space around them."""
    if delimiter == " ":
        return _SPACES.split(line.strip())
    # Line by line: a stray quotation mark must not join lines.
    return [cell.strip() for row in csv.reader([line], delimiter=delimiter) for cell in row]
