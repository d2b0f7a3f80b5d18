"""Columns that a file gives as arrays, and values of any type as numbers and text."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.types import FloatArray
from triaxcal.readings.format import PIECE, Block, Source
from triaxcal.unit.recordingfile import FileLayout


class ArraySource(Source):
    """Columns that stand ready as arrays of one length, or as what slices like one.

    An array of two dimensions is as many columns, named `name[0]`, `name[1]`. The columns of the
    array `layout.variable`, or of the only one of two dimensions, are also counted from 1.

    Parameters
    ----------
    path : str
    arrays : mapping of str to arrays of one or two dimensions
        Each needs `shape`, `dtype` and slicing: numpy arrays, data sets of HDF5.
    """

    def __init__(self, path: str, arrays: Mapping[str, Any], layout: FileLayout) -> None:
        self._path = path
        self._columns: list[tuple[str, Any, int | None]] = []
        matrices: dict[str, range] = {}
        for name, array in arrays.items():
            if len(array.shape) == 1:
                self._columns.append((name, array, None))
                continue
            first = len(self._columns)
            self._columns += [(f"{name}[{k}]", array, k) for k in range(array.shape[1])]
            matrices[name] = range(first, len(self._columns))
        if layout.variable is not None and layout.variable not in matrices:
            hint = did_you_mean(layout.variable, matrices)
            raise RefusedError(
                path,
                f"no matrix {shown(layout.variable)}{hint}",
                expected="one of " + ", ".join(matrices) if matrices else "a matrix",
            )
        if layout.variable is not None:
            self.numbered = matrices[layout.variable]
        elif len(matrices) == 1:
            self.numbered = next(iter(matrices.values()))
        self.names = tuple(name for name, _, _ in self._columns)

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
        for start in range(0, count, PIECE):
            part = slice(start, min(start + PIECE, count))
            rows = np.arange(part.start + 1, part.stop + 1)
            values = np.empty((len(rows), len(numbers)))
            for place, k in enumerate(numbers):
                values[:, place] = doubles(self._path, self.names[k], self._cut(k, part))
            yield Block(values, tuple(texts_of(self._cut(k, part)) for k in texts), rows)

    def _cut(self, k: int, part: slice) -> Any:
        _, array, inner = self._columns[k]
        return np.asarray(array[part] if inner is None else array[part, inner])


def doubles(path: str, name: str, values: Any) -> FloatArray:
    """Numbers of a column of any numeric type, shape (n,); NaN for None and infinities.

    Raises
    ------
    RefusedError
        For text and dates.
    """
    array = np.asarray(values)
    try:
        if array.dtype.kind not in "biufO":
            raise ValueError
        found = array.astype(np.float64)
    except (ValueError, TypeError) as error:
        first = array.flat[0] if array.size else ""
        raise RefusedError(
            f"{path}, column {name}",
            f"holds {array.dtype}, the first is {str(first)[:40]!r}",
            expected="numbers",
            remedy="write the column as numbers, or name another",
        ) from error
    return np.where(np.isfinite(found), found, np.nan)


def texts_of(values: Any) -> list[str]:
    """Text of a column of any type: dates as ISO 8601, whole numbers without a point."""
    array = np.asarray(values)
    if array.dtype.kind == "M":
        return [str(text) for text in np.datetime_as_string(array)]
    return [_text(value) for value in array.tolist()]


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return f"{value:g}" if isinstance(value, float) else str(value)
