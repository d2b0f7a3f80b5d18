"""Rows of numbers kept in a temporary file: read in pieces, so that memory has no more than one."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterator

import numpy as np

from triaxcal.base.errors import refused_by_system
from triaxcal.model.types import FloatArray
from triaxcal.readings.format import PIECE

_IN_MEMORY = 1 << 26
"""Bytes: a short recording needs no file."""
SAMPLED = 1 << 18
"""Rows that statistics of all rows are taken from, where there are more."""
_STRETCH = 16


class Spool:
    """Rows of doubles, appended first and then read, as often as wanted.

    The file is on the disk of the temporary folder (TMPDIR) and has 8 bytes a number.
    """

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self._file = tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, rows: FloatArray) -> None:
        """Add rows, shape (n, columns).

        Raises
        ------
        RefusedError
            When the temporary folder is full or cannot be written.
        """
        try:
            self._file.seek(0, 2)
            self._file.write(np.ascontiguousarray(rows, dtype=np.float64).data)
        except OSError as error:
            needed = 8 * self.columns * (self._count + len(rows)) / 2**20
            raise refused_by_system(
                tempfile.gettempdir(),
                "written",
                error,
                expected=f"more than {needed:.0f} MiB free: 8 bytes for each number of a recording",
                remedy="set TMPDIR to a folder with more space",
            ) from error
        self._count += len(rows)

    def to_file(self) -> None:
        """Keep the rows in the file even if they are few: one spool of many."""
        self._file.rollover()

    def rows(self, start: int, stop: int) -> FloatArray:
        """Rows from `start` to `stop`, stop excluded, shape (n, columns)."""
        stop = min(stop, self._count)
        self._file.seek(8 * self.columns * start)
        data = self._file.read(8 * self.columns * (stop - start))
        return np.frombuffer(data, dtype=np.float64).reshape(-1, self.columns)

    def pieces(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Index of the first row and the rows of each piece from `start` to `stop`."""
        stop = self._count if stop is None else min(stop, self._count)
        for first in range(start, stop, PIECE):
            yield first, self.rows(first, min(first + PIECE, stop))

    def stretches(self) -> list[FloatArray]:
        """All rows; of more than `SAMPLED`, as many in short stretches, evenly spaced.

        Stretches and not single rows: what repeats every few rows is seen in its true share.
        """
        if self._count <= SAMPLED:
            return [self.rows(0, self._count)]
        starts = np.linspace(0, self._count - _STRETCH, SAMPLED // _STRETCH).astype(np.int64)
        return [self.rows(start, start + _STRETCH) for start in starts.tolist()]

    def thinned(self) -> FloatArray:
        """Evenly spaced rows, at most `PIECE`: for pictures."""
        step = -(-self._count // PIECE)
        return np.concatenate([rows[-first % step :: step].copy() for first, rows in self.pieces()])
