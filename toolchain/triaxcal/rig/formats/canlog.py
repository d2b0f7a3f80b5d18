"""Signals of a log of CAN frames as the columns of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.readings.arrays import Pieces
from triaxcal.readings.format import PIECE, Block, Format, Source
from triaxcal.unit.recordingfile import CAN_LOG, FileLayout

if TYPE_CHECKING:
    from triaxcal.rig.frames import Frames
    from triaxcal.rig.layout import FrameLayout

_TIME = "time"


class _CanLog(Source):
    """A table is a message, a column a signal's physical value; each has its time of arrival."""

    def __init__(self, path: Path, layout: FileLayout) -> None:
        from triaxcal.rig.busfile import read_bus_file  # noqa: PLC0415  cantools takes its time

        if layout.dbc is None:
            raise RefusedError(
                f"{path}, [{layout.table}]",
                "a log of CAN frames, and no bus description",
                expected='dbc = "FILE", which says where its signals are',
                remedy="put the DBC, KCD, SYM or ARXML file beside it, and name it",
            )
        bus = read_bus_file(path.parent / layout.dbc)
        self._path = path
        self._columns: list[tuple[FrameLayout, str]] = []
        for message in bus.layouts():
            self._columns += [(message, name) for name in (_TIME, *message.signals)]
        self.names = tuple(f"{message.name}.{name}" for message, name in self._columns)
        self.tables = tuple(message.name for message, _ in self._columns)
        times = [k for k, (_, name) in enumerate(self._columns) if name == _TIME]
        self.clocks = {self.tables[k]: (k, "ns") for k in reversed(times)}
        self._warnings = bus.warnings
        self._left: list[str] = []

    @property
    def findings(self) -> tuple[str, ...]:  # type: ignore[override]  # known when it is read
        """What was left out."""
        return (*self._warnings, *self._left)

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`.

        Raises
        ------
        RefusedError
            When the log cannot be read, has no frame of the message, or has some of several
            channels.
        """
        from triaxcal.rig.logfile import Left, read_frames  # noqa: PLC0415

        pieces = Pieces(str(self._path), self.names, numbers, texts)
        message = self._columns[pieces.wanted[0]][0]
        wanted = [self._columns[k][1] for k in pieces.wanted]
        left, channels, short, count = Left(), set[bytes](), 0, 0
        for parsed in read_frames(self._path):
            left.add(parsed)
            mine = parsed.frames.take(message.mine(parsed.frames.can_id))
            whole = mine.take(mine.length >= message.size)
            short += len(mine) - len(whole)
            frames = _with_all(message, whole, wanted)
            channels |= set(np.unique(frames.channel).tolist())
            self._refuse_channels(message, channels)
            count += len(frames)
            for start in range(0, len(frames), PIECE):
                part = frames.take(slice(start, start + PIECE))
                columns = {k: _values(part, *self._columns[k]) for k in pieces.wanted}
                yield pieces.block(columns)
        if not count:
            raise RefusedError(
                str(self._path),
                f"no frame of {message.name} (ID 0x{message.frame_id:X})",
                expected="the log of the bus that the description is about",
            )
        too_short = [f"{short} frames of {message.name} are too short"] if short else []
        self._left = [*left.notes(self._path.name), *too_short]

    def _refuse_channels(self, message: FrameLayout, channels: set[bytes]) -> None:
        if len(channels) > 1:
            names = ", ".join(sorted(name.decode("ascii", "replace") for name in channels))
            raise RefusedError(
                str(self._path),
                f"{message.name} comes on several channels: {names}",
                expected="one sensor",
                remedy="keep the lines of one channel",
            )


def _with_all(message: FrameLayout, frames: Frames, names: Sequence[str]) -> Frames:
    """Frames of a message that hold all of these signals: others have them multiplexed away."""
    for name in names:
        for condition in message.multiplexed.get(name, ()):
            frames = frames.take(condition.holds(frames.data))
    return frames


def _values(frames: Frames, message: FrameLayout, name: str) -> Any:
    return frames.t_ns if name == _TIME else message.signals[name].value(frames.data)


def _open(path: Path, layout: FileLayout) -> Source:
    return _CanLog(path, layout)


ENTRY = Format(
    name=CAN_LOG,
    label="a log of CAN frames",
    doc="With `dbc`: a column is a signal, as Message.Signal, in the unit of the bus description. "
    "The axes are signals of one message, whose clock is the time of arrival. ASC, BLF, CSV, MF4 "
    "(bus logging), SQLite, TRC and text of candump, also compressed by gzip.",
    open=_open,
    extensions=(".asc", ".blf", ".trc"),
    package="cantools",
    extra="rig",
)
