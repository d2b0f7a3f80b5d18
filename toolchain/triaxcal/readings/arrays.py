"""Columns that a file gives as arrays, and values of any type as numbers and text."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.format import PIECE, Block, Source
from triaxcal.readings.names import in_table
from triaxcal.readings.numbertext import number_of, remedy_of
from triaxcal.unit.recordingfile import FileLayout


class ArraySource(Source):
    """Columns that stand ready as arrays of one length, or as what slices like one.

    An array of two dimensions is as many columns, named `name[0]`, `name[1]`; one of records is a
    column for each field, `name.field`. The columns of the array `layout.variable`, or of the only
    one of two dimensions, are also counted from 1.

    Parameters
    ----------
    path : str
    arrays : mapping of str to arrays of one or two dimensions
        Each needs `shape`, `dtype` and slicing: numpy arrays, data sets of HDF5.
    """

    def __init__(self, path: str, arrays: Mapping[str, Any], layout: FileLayout) -> None:
        self._path, self._decimal = path, layout.decimal
        self._columns: list[tuple[str, Any, str, int | None]] = []
        matrices: dict[str, range] = {}
        for name, array in arrays.items():
            first = len(self._columns)
            for field in array.dtype.names or ("",):
                kind = array.dtype[field] if field else np.dtype((array.dtype, array.shape[1:]))
                full = ".".join(part for part in (name, field) if part)
                if not kind.shape:
                    self._columns.append((full, array, field, None))
                elif len(kind.shape) == 1:
                    width = range(kind.shape[0])
                    self._columns += [(f"{full}[{k}]", array, field, k) for k in width]
            if len(array.shape) == 2 or array.dtype.names:
                matrices[name] = range(first, len(self._columns))
        self.names = tuple(column[0] for column in self._columns)
        if layout.variable in matrices:
            self.numbered = matrices[layout.variable]
        elif layout.variable is None and len(matrices) == 1:
            self.numbered = next(iter(matrices.values()))
        elif layout.variable is not None and not in_table(layout.variable, self.names):
            hint = did_you_mean(layout.variable, matrices)
            raise RefusedError(
                path,
                f"no matrix {shown(layout.variable)}{hint}",
                expected="one of " + ", ".join(matrices) if matrices else "a matrix",
            )

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        lengths = {self.names[k]: int(self._columns[k][1].shape[0]) for k in (*numbers, *texts)}
        if len(set(lengths.values())) > 1:
            raise RefusedError(
                self._path,
                "columns of different lengths: "
                + ", ".join(f"{n} {k}" for n, k in lengths.items()),
                expected="one value a sample in each",
                remedy="name columns that belong together, or save them at one rate",
            )
        count = next(iter(lengths.values()))
        pieces = Pieces(self._path, self.names, numbers, texts, self._decimal)
        for start in range(0, count, PIECE):
            part = slice(start, min(start + PIECE, count))
            yield pieces.block({k: self._cut(k, part) for k in pieces.wanted})

    def _cut(self, k: int, part: slice) -> Any:
        _, array, field, inner = self._columns[k]
        if not field:
            return np.asarray(array[part] if inner is None else array[part, inner])
        values = np.asarray(array[part])[field]
        return values if inner is None else values[:, inner]


class Pieces:
    """Blocks of the columns of a file that is read piece after piece.

    Parameters
    ----------
    path : str
    names : sequence of str
        Of all columns, for messages.
    numbers, texts : indices into `names`
        As of `Source.blocks`; `wanted` has both, each once and in order.
    decimal : str
        Sign before the decimals of numbers that are text.
    """

    def __init__(
        self,
        path: str,
        names: Sequence[str],
        numbers: Sequence[int],
        texts: Sequence[int],
        decimal: str = ".",
    ) -> None:
        self._path, self._names, self._decimal = path, names, decimal
        self._numbers, self._texts = numbers, texts
        self._count = 0
        self._starts: dict[int, int] = {}
        self.wanted = sorted({*numbers, *texts})

    def block(self, columns: Mapping[int, Any], rows: IntArray | None = None) -> Block:
        """Block of the next piece.

        Parameters
        ----------
        columns : mapping of int to arrays of shape (n,)
            Values in this piece, of any type, of the columns `wanted`.
        rows : array, shape (n,), or None
            None counts them.

        Raises
        ------
        RefusedError
            Where a column of numbers holds text or dates.
        """
        count = len(columns[self.wanted[0]])
        if rows is None:
            rows = np.arange(self._count + 1, self._count + count + 1)
        self._count += count
        numbers = np.empty((count, len(self._numbers)))
        for place, k in enumerate(self._numbers):
            start = self._starts.setdefault(k, _start(columns[k]))
            try:
                numbers[:, place] = _doubles(columns[k], start, self._decimal)
            except (ValueError, TypeError) as error:
                row, cell = _no_number(columns[k], self._decimal)
                raise RefusedError(
                    f"{self._path}, row {rows[row]}, column {self._names[k]}",
                    f"found {cell[:40]!r}",
                    expected="a number",
                    remedy=remedy_of(cell) or "write the column as numbers, or name another",
                ) from error
        return Block(numbers, tuple(texts_of(columns[k]) for k in self._texts), rows)


def column_of(values: Sequence[Any]) -> Any:
    """Array of values of any kinds; a text among numbers does not make them texts."""
    if {type(value) for value in values} <= {int, float}:
        return np.asarray(values)
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def _start(values: Any) -> int:
    """First of whole numbers that doubles cannot hold exactly; 0 of any other values."""
    first = int(values[0]) if values.dtype.kind in "iu" and len(values) else 0
    return first if abs(first) >= 2**53 else 0


def _doubles(values: Any, start: int, decimal: str) -> FloatArray:
    """Numbers less `start`; NaN stands for None and for infinities."""
    if values.dtype.kind not in "iufO":
        raise ValueError
    if values.dtype.kind == "O" and {type(value) for value in values} & {str, bool}:
        values = np.array([_double(value, decimal) for value in values])
    if start:
        # Two's complement: exact for unsigned values as well.
        values = values.astype(np.int64) - np.array(start, values.dtype).astype(np.int64)
    found: FloatArray = values.astype(np.float64)
    found[~np.isfinite(found)] = np.nan
    return found


def _double(value: Any, decimal: str) -> float:
    if isinstance(value, bool):
        raise TypeError
    if isinstance(value, str):
        return number_of(value, decimal)
    return float("nan") if value is None else float(value)


def _no_number(values: Any, decimal: str) -> tuple[int, str]:
    """Index and text of the first that is no number."""
    for index, value in enumerate(values.tolist() if values.dtype.kind == "O" else ()):
        try:
            _double(value, decimal)
        except (ValueError, TypeError):
            return index, _text(value)
    return 0, texts_of(values[:1])[0]


def texts_of(values: Any) -> list[str]:
    """Text of a column of any type: dates as ISO 8601, whole numbers without a point."""
    array = np.asarray(values)
    if array.dtype.kind == "M":
        return ["" if text == "NaT" else str(text) for text in np.datetime_as_string(array)]
    return [_text(value) for value in array.tolist()]


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return f"{value:g}" if isinstance(value, float) else str(value)
