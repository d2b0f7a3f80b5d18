"""Delimited text: a header or none, any encoding, read in blocks of lines.

Blocks without quotation marks, comments and gaps go through numpy's parser. All others are split
cell by cell, which also finds the place of a mistake.
"""

from __future__ import annotations

import codecs
import csv
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown
from triaxcal.model.types import FloatArray
from triaxcal.readings.format import PIECE, Block, Format, Source
from triaxcal.readings.numbertext import number_of, remedy_of
from triaxcal.readings.preamble import LOOKED_AT, Line, find_table, split_cells
from triaxcal.unit.recordingfile import DELIMITERS, FileLayout

_LINE_MAX = 1 << 20
"""Characters of a line at most: a document on one line is no table."""
_NEIGHBOURS = 8
"""Lines beyond those looked at: the last of them has neighbours too."""
_BYTES = 1 << 20


class TextSource(Source):
    """A text file of rows of cells."""

    row_word = "line"

    def __init__(self, path: Path, layout: FileLayout) -> None:
        self._path, self._layout = path, layout
        self._codec = _codec(path)
        head = self._head()
        if all(line.comment for line in head):
            raise RefusedError(
                str(path),
                "no rows",
                expected="rows of numbers",
                remedy="check skip_rows and comment",
            )
        try:
            self._found = found = find_table(head, layout)
        except csv.Error as error:
            limit = csv.field_size_limit()
            long = next((line for line in head if len(line.text) > limit), head[0])
            raise self._no_cells(long.number, long.text) from error
        if not found.start:
            raise RefusedError(str(path), "a header but no rows", expected="rows of numbers")
        if found.names and len(found.names) != found.width:
            raise RefusedError(
                f"{path}, line {found.start}",
                f"{found.width} cells under {len(found.names)} names",
                expected="as many cells as names",
                remedy=f"check delimiter, decimal and header in [{layout.table}]",
            )
        self.names = found.names or ("",) * found.width
        self.numbered = range(found.width)
        (self.separated,) = (name for name, sign in DELIMITERS.items() if sign == found.delimiter)
        self.findings = found.findings

    def _opened(self) -> TextIO:
        return self._path.open(encoding=self._codec, newline=None)

    def _head(self) -> list[Line]:
        found: list[Line] = []
        plain = 0
        comment = self._layout.comment
        with self._opened() as file:
            for number, line in enumerate(iter(lambda: file.readline(_LINE_MAX + 1), ""), start=1):
                if len(line) > _LINE_MAX:
                    raise RefusedError(
                        f"{self._path}, line {number}",
                        f"more than {_LINE_MAX} characters",
                        expected="a row of the recording in each line",
                        remedy="export the recording as CSV, a line for each row",
                    )
                if number <= self._layout.skip_rows or not line.strip():
                    continue
                is_comment = bool(comment) and line.lstrip().startswith(comment)
                text = line.lstrip().removeprefix(comment) if is_comment else line
                found.append(Line(number, text.rstrip("\n"), is_comment))
                plain += not is_comment
                if plain == LOOKED_AT + _NEIGHBOURS:
                    break
        return found

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`; a last line cut short is left out.

        Raises
        ------
        RefusedError
            At the first cell that is no number, and at a line with another number of cells.
        """
        with self._opened() as file:
            line = self._found.start
            lines = list(islice(file, line - 1, line - 1 + PIECE))
            while lines:
                following = list(islice(file, PIECE))
                block = self._fast(lines, line, numbers, texts)
                yield block or self._careful(lines, line, numbers, texts, last=not following)
                line += len(lines)
                if not following and not lines[-1].endswith("\n"):
                    # A line that lacks cells has been reported already.
                    cut = ("the last line has no line end: it may be cut",)
                    self.findings += cut if self.findings == self._found.findings else ()
                lines = following

    def _fast(
        self, lines: list[str], first: int, numbers: Sequence[int], texts: Sequence[int]
    ) -> Block | None:
        """Block by numpy's parser; None where a line is out of the ordinary."""
        delimiter, comment = self._found.delimiter, self._layout.comment
        joined = "".join(lines)
        if '"' in joined or (comment and comment in joined):
            return None
        if delimiter == " ":
            separators = {len(line.split()) - 1 for line in lines}
        else:
            separators = {line.count(delimiter) for line in lines}
        if separators != {self._found.width - 1 + self._found.closed}:
            return None
        values = np.empty((len(lines), 0))
        if numbers:
            if self._layout.decimal == ",":
                joined = joined.replace(",", ".")
            try:
                values = np.loadtxt(
                    joined.splitlines() if self._layout.decimal == "," else lines,
                    delimiter=None if delimiter == " " else delimiter,
                    usecols=list(numbers),
                    comments=None,
                    ndmin=2,
                )
            except ValueError:
                return None
        if len(values) != len(lines):
            return None
        split = [[cell.strip() for cell in self._split(line)] for line in lines] if texts else []
        found = tuple([cells[k] for cells in split] for k in texts)
        return Block(_finite(values), found, np.arange(first, first + len(lines)))

    def _split(self, line: str) -> list[str]:
        return line.split(None if self._found.delimiter == " " else self._found.delimiter)

    def _careful(
        self,
        lines: list[str],
        first: int,
        numbers: Sequence[int],
        texts: Sequence[int],
        *,
        last: bool,
    ) -> Block:
        """Block cell by cell; `last` where no line follows."""
        width, comment = self._found.width, self._layout.comment
        rows: list[list[str]] = []
        places: list[int] = []
        short = short_cells = 0
        for place, line in enumerate(lines, start=first):
            if not line.strip() or (comment and line.lstrip().startswith(comment)):
                continue
            try:
                cells = split_cells(line.rstrip("\n"), self._found.delimiter)
            except csv.Error as error:
                raise self._no_cells(place, line.rstrip("\n")) from error
            if self._found.closed and len(cells) == width + 1 and not cells[-1]:
                cells.pop()
            if short or len(cells) > width or (len(cells) < width and not last):
                raise self._ragged(*((short, short_cells) if short else (place, len(cells))))
            if len(cells) < width:
                short, short_cells = place, len(cells)
                continue
            rows.append(cells)
            places.append(place)
        if short and not rows:
            raise self._ragged(short, short_cells)
        if short:
            self.findings = (
                *self._found.findings,
                f"the last line, {short}, is cut short: left out",
            )
        values = np.empty((len(rows), len(numbers)))
        for k, column in enumerate(numbers):
            values[:, k] = self._numbers([row[column] for row in rows], places, column)
        found = tuple([row[column] for row in rows] for column in texts)
        return Block(values, found, np.array(places, dtype=np.int64))

    def _numbers(self, cells: list[str], places: list[int], column: int) -> FloatArray:
        if self._layout.decimal == ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            return _finite(np.array([cell or "nan" for cell in cells], dtype=np.float64))
        except ValueError:
            pairs = zip(cells, places, strict=True)
            return np.array([self._number(cell, place, column) for cell, place in pairs])

    def _number(self, cell: str, place: int, column: int) -> float:
        try:
            return number_of(cell, self._layout.decimal)
        except ValueError as error:
            raise RefusedError(
                f"{self._path}, line {place}, column {self.names[column] or column + 1}",
                f"found {shown(cell)}",
                expected="a number",
                remedy=remedy_of(cell),
            ) from error

    def _ragged(self, place: int, cells: int) -> RefusedError:
        return RefusedError(
            f"{self._path}, line {place}",
            f"{cells} cells",
            expected=f"{self._found.width}, as in line {self._found.start}",
            remedy=f"check delimiter and decimal in [{self._layout.table}], or remove the line",
        )

    def _no_cells(self, place: int, line: str) -> RefusedError:
        """What is no row of cells: a quotation mark that is not closed, a document on one line."""
        return RefusedError(
            f"{self._path}, line {place}",
            f"a cell of more than {csv.field_size_limit()} characters, in a line of {len(line)}",
            expected="rows of numbers",
            remedy="export the recording as CSV, or remove the line",
        )


def _finite(values: FloatArray) -> FloatArray:
    values[~np.isfinite(values)] = np.nan
    return values


def _codec(path: Path) -> str:
    """Encoding of a text; Latin-1, which holds every byte, where it is not all UTF-8.

    A degree sign in a header must not stop a file of numbers.
    """
    with path.open("rb") as file:
        wide = _wide(file.read(4096))
        file.seek(0)
        decoder = codecs.getincrementaldecoder(wide or "utf-8-sig")()
        done = 0
        while True:
            part = file.read(_BYTES)
            waiting = len(decoder.getstate()[0])
            try:
                decoder.decode(part, final=not part)
            except UnicodeDecodeError as error:
                if not wide:
                    return "latin-1"
                raise RefusedError(
                    str(path),
                    f"begins as {wide[:6].upper()} text, but byte {done - waiting + error.start} "
                    "is none",
                    expected="text in one encoding",
                    remedy="save the file as UTF-8",
                ) from error
            if not part:
                return wide or "utf-8-sig"
            done += len(part)


def _wide(head: bytes) -> str:
    """Codec of UTF-32 by its mark, of UTF-16 by it or every other byte being 0; "" of all else."""
    if head[:4] in {b"\xff\xfe\0\0", b"\0\0\xfe\xff"}:  # begins with UTF-16's mark: asked first
        return "utf-32"
    if head[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return "utf-16"
    even, odd = head[::2].count(0), head[1::2].count(0)
    if len(head) >= 4 and not even and odd > 0.9 * (len(head) // 2):
        return "utf-16-le"
    if len(head) >= 4 and not odd and even > 0.9 * (len(head) // 2):
        return "utf-16-be"
    return ""


def _is_text(head: bytes) -> bool:
    return bool(_wide(head)) or b"\0" not in head


ENTRY = Format(
    name="text",
    label="delimited text",
    doc="Rows of cells, with a header or without; delimiter, encoding and header are found.",
    open=TextSource,
    sniff=_is_text,
    rank=900,
    ours=True,
)
