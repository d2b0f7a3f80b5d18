"""ASAM MDF (MF4) by asammdf, read in pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from traceback import walk_tb
from typing import Any
from weakref import finalize

import numpy as np

from triaxcal.readings.arrays import Pieces
from triaxcal.readings.format import PIECE, Block, Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout


class _Mf4(Source):
    def __init__(self, path: Path, layout: FileLayout) -> None:  # noqa: ARG002
        self._path, self._file = path, _opened(path)
        # An MDF is part of a cycle: without this its file would be left to the garbage collection.
        finalize(self, self._file.close)
        groups = self._file.groups
        self._place = [(g, c) for g in range(len(groups)) for c in range(len(groups[g].channels))]
        titles = [_title(g, group) for g, group in enumerate(groups)]
        self.tables = tuple(titles[g] for g, _ in self._place)
        self.names = tuple(f"{titles[g]}.{groups[g].channels[c].name}" for g, c in self._place)
        self.clocks = {
            titles[g]: (self._place.index((g, c)), "s") for g, c in self._file.masters_db.items()
        }

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        pieces = Pieces(str(self._path), self.names, numbers, texts)
        group = self._place[pieces.wanted[0]][0]
        count = self._file.groups[group].channel_group.cycles_nr
        for start in range(0, count, PIECE):
            yield pieces.block({k: self._values(k, start) for k in pieces.wanted})

    def _values(self, k: int, start: int) -> Any:
        group, channel = self._place[k]
        signal = self._file.get(
            group=group,
            index=channel,
            record_offset=start,
            record_count=PIECE,
            ignore_invalidation_bits=True,
        )
        values = signal.samples
        if signal.invalidation_bits is not None and values.dtype.kind in "iuf":
            values = np.where(np.asarray(signal.invalidation_bits), np.nan, values)
        return values


def _opened(path: Path) -> Any:
    from asammdf import MDF  # noqa: PLC0415  optional, and slow to import

    try:
        return MDF(path)
    except Exception as error:
        # asammdf closes what it could not open when Python lets go of it, fails, and prints that.
        # It closes once only, so it is done here.
        for frame, _ in walk_tb(error.__traceback__):
            half: Any = frame.f_locals.get("self")
            with suppress(Exception):
                half.close()
        raise


def _title(number: int, group: Any) -> str:
    """Name of a group of channels that share a clock: its own, else its number from 0."""
    return group.channel_group.acq_name or f"group{number}"


ENTRY = Format(
    name="mf4",
    label="ASAM MDF (MF4)",
    doc="A column is a channel; where several groups have one of that name, group.channel, the "
    "group by its name or as group0. Its clock is the group's time. Read in pieces.",
    open=_Mf4,
    extensions=(".mf4", ".mdf"),
    sniff=starts_with(b"MDF  ", b"UnFinMF "),
    package="asammdf",
    extra="mf4",
)
