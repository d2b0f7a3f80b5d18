"""Workbooks of Excel by openpyxl, read row after row."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.readings.arrays import Pieces, column_of
from triaxcal.readings.format import PIECE, Block, Format, Source
from triaxcal.readings.numbertext import is_word
from triaxcal.unit.recordingfile import FileLayout

_HEADER_WITHIN, _HEADER_CELLS = 20, 3
"""Rows from the top of a sheet; texts in a row of names at least."""

_Row = tuple[int, tuple[Any, ...]]


class _Excel(Source):
    def __init__(self, path: Path, layout: FileLayout) -> None:
        self._path, self._layout = path, layout
        names: list[str] = []
        tables: list[str] = []
        self._place: list[int] = []
        for sheet, top in ((sheet.title, list(islice(rows, _HEADER_WITHIN)))
                           for sheet, rows in self._sheets()):  # fmt: skip
            header = self._header(top)
            cells = header[1] if header else max((row for _, row in top), key=len, default=())
            texts = [str(c).strip() if header and c is not None else "" for c in cells]
            names += [f"{sheet}.{text}" if text else "" for text in texts]
            tables += [sheet] * len(texts)
            self._place += range(len(texts))
        self.names, self.tables = tuple(names), tuple(tables)
        numbered = layout.variable or next(iter(tables), "")
        if layout.variable or len(set(tables)) == 1:
            self.numbered = [k for k, t in enumerate(tables) if t.lower() == numbered.lower()]

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        pieces = Pieces(str(self._path), self.names, numbers, texts, self._layout.decimal)
        for sheet, rows in self._sheets():
            if sheet.title != self.tables[pieces.wanted[0]]:
                continue
            top = list(islice(rows, _HEADER_WITHIN))
            header = self._header(top)
            below = [row for row in top if not header or row[0] > header[0]]
            words = list(takewhile(self._words, below)) if header else []
            if words:
                rows_word = f"{len(words)} row{'s' * (len(words) != 1)}"
                self.findings = (f"{rows_word} left out above the rows, from row {words[0][0]} on",)
            body = chain(below[len(words) :], rows)
            while part := list(islice(body, PIECE)):
                yield pieces.block(
                    {k: column_of([_cell(row, self._place[k]) for _, row in part])
                     for k in pieces.wanted},
                    np.array([number for number, _ in part]),
                )  # fmt: skip

    def _sheets(self) -> Iterator[tuple[Any, Iterator[_Row]]]:
        """Sheets, and their rows that hold anything, numbered as Excel does."""
        from openpyxl import load_workbook  # noqa: PLC0415  optional

        skip = self._layout.skip_rows
        with self._path.open("rb") as file:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of styles and validations that it drops
                book = load_workbook(file, read_only=True, data_only=True)
            for sheet in book.worksheets:
                sheet.reset_dimensions()  # what the file says of them is often wrong
                rows = enumerate(sheet.iter_rows(values_only=True), 1)
                yield sheet, (r for r in rows if r[0] > skip and any(c is not None for c in r[1]))

    def _header(self, top: list[_Row]) -> _Row | None:
        """Row of names among the first: one of texts, unless the layout says that there is none."""
        if self._layout.header is False:
            return None
        texts = ((sum(isinstance(cell, str) for cell in row[1]), row) for row in top)
        return next((row for count, row in texts if count >= _HEADER_CELLS), None)

    def _words(self, row: _Row) -> bool:
        """Whether all cells of a row are words, as units below the names are."""
        decimal = self._layout.decimal
        return all(isinstance(c, str) and is_word(c, decimal) for c in row[1] if c is not None)


def _cell(row: tuple[Any, ...], place: int) -> Any:
    return row[place] if place < len(row) else None


ENTRY = Format(
    name="excel",
    label="Excel",
    doc="A column is sheet.name, by the first row of names; of a sheet without one, a number from "
    "1. Read row after row; cells with formulas give the values that Excel saved.",
    open=_Excel,
    extensions=(".xlsx", ".xlsm"),
    sniff=lambda head: (
        head.startswith(b"PK\x03\x04")
        and any(part in head for part in (b"[Content_Types].xml", b"xl/", b"_rels/", b"docProps/"))
    ),
    package="openpyxl",
    extra="excel",
)
