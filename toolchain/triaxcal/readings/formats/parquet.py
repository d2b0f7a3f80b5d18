"""Parquet by pyarrow, read in pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from triaxcal.readings.arrays import Pieces
from triaxcal.readings.format import PIECE, Block, Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout


class _Parquet(Source):
    def __init__(self, path: Path, layout: FileLayout) -> None:  # noqa: ARG002
        from pyarrow import parquet  # noqa: PLC0415  optional

        self._path = path
        with parquet.ParquetFile(path) as file:
            self.names = tuple(column.path for column in file.schema)
        self.numbered = range(len(self.names))

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        from pyarrow import parquet  # noqa: PLC0415

        pieces = Pieces(str(self._path), self.names, numbers, texts)
        wanted = list(dict.fromkeys(self.names[k] for k in pieces.wanted))
        # Of two columns with one name both come.
        given = [k for name in wanted for k, other in enumerate(self.names) if other == name]
        with parquet.ParquetFile(self._path) as file:
            for batch in file.iter_batches(PIECE, columns=wanted):
                yield pieces.block(dict(zip(given, _leaves(batch.columns), strict=True)))


def _leaves(columns: Sequence[Any]) -> Iterator[Any]:
    """Columns as arrays; fields of structures in their place."""
    import pyarrow  # noqa: PLC0415

    for column in columns:
        if isinstance(column, pyarrow.StructArray):
            yield from _leaves(column.flatten())
        else:
            yield column.to_numpy(zero_copy_only=False)


ENTRY = Format(
    name="parquet",
    label="Parquet",
    doc="A column by its name; a field of a structure as imu.ax. Read in pieces.",
    open=_Parquet,
    extensions=(".parquet",),
    sniff=starts_with(b"PAR1"),
    package="pyarrow",
    extra="parquet",
)
