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
    from triaxcal.rig.bus.frames import Frames
    from triaxcal.rig.description.layout import FrameLayout
    from triaxcal.rig.logs.logfile import Left

_TIME = "time"


class _CanLog(Source):
    """A table is a message, a column a signal's physical value; each has its time of arrival."""

    def __init__(self, path: Path, layout: FileLayout) -> None:
        from triaxcal.rig.description.busfile import read_bus_file  # noqa: PLC0415  cantools takes its time
        from triaxcal.rig.description.recorded import unit_of  # noqa: PLC0415  with the bench

        if layout.dbc is None:
            raise RefusedError(
                f"{path}, [{layout.table}]",
                "a log of CAN frames, and no bus description",
                expected='dbc = "FILE", or rig = "rig.toml", which say where its signals are',
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
        units = {
            k: unit_of(m.signals[n].unit) for k, (m, n) in enumerate(self._columns) if n != _TIME
        }
        self.units = {k: unit for k, unit in units.items() if unit}
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
        from triaxcal.rig.logs.logfile import Left, read_frames  # noqa: PLC0415

        pieces = Pieces(str(self._path), self.names, numbers, texts)
        message = self._columns[pieces.wanted[0]][0]
        wanted = [self._columns[k][1] for k in pieces.wanted]
        left, channels, short, count, mine_count, empty = Left(), set[bytes](), 0, 0, 0, 0
        for parsed in read_frames(self._path):
            left.add(parsed)
            left.refuse_differences(self._path)
            mine = parsed.frames.take(message.mine(parsed.frames.can_id))
            whole = mine.take(mine.length >= message.size)
            mine_count += len(mine)
            short += len(mine) - len(whole)
            held = _with_all(message, whole, wanted)
            frames = _with_numbers(message, held, wanted)
            empty += len(held) - len(frames)
            channels |= set(np.unique(frames.channel).tolist())
            self._refuse_channels(message, channels)
            count += len(frames)
            for start in range(0, len(frames), PIECE):
                part = frames.take(slice(start, start + PIECE))
                columns = {k: _values(part, *self._columns[k]) for k in pieces.wanted}
                yield pieces.block(columns)
        name = self._path.name
        said = [f"{short} frames of {message.name} are too short"] if short else []
        if empty:
            said.append(
                f"{empty} frames of {message.name} hold no value (error, not available), left out"
            )
        if not count:
            signals = [name for name in wanted if name != _TIME]
            raise self._none(message, signals, mine_count, said, left)
        self._left = [*left.notes(name), *said, *_unseen(message, wanted)]

    def _none(
        self, message: FrameLayout, names: Sequence[str], count: int, said: list[str], left: Left
    ) -> RefusedError:
        """Why there is no row."""
        place, name = str(self._path), f"{message.name} (ID 0x{message.frame_id:X})"
        selectors = {c.selector.name for n in names for c in message.multiplexed.get(n, ())}
        if said:
            return RefusedError(place, f"{name}: none of {count} frames is whole: {said[0]}")
        if count and selectors:
            return RefusedError(
                place,
                f"{name}: {count} frames, and none holds all of {', '.join(names)}: they are "
                f"multiplexed by {', '.join(sorted(selectors))}",
                expected="signals of one frame: a row of [recording] is a frame",
                remedy='rig = "rig.toml" in place of dbc: a rig description joins them',
            )
        if left.lines and not left.frames:
            return RefusedError(
                place,
                f"no frames in it; its first line is {left.first}",
                expected="a log of CAN frames",
            )
        return RefusedError(
            place,
            f"no frame of {name}",
            expected="the log of the bus that the description is about",
        )

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


def _with_numbers(message: FrameLayout, frames: Frames, names: Sequence[str]) -> Frames:
    """Frames of a message whose signals hold numbers, by J1939; the bench drops the same."""
    from triaxcal.rig.description.description import MessageUse  # noqa: PLC0415  with the bench
    from triaxcal.rig.description.rows import available  # noqa: PLC0415

    use = MessageUse(message)
    for signal in (message.signals[name] for name in names if name != _TIME):
        there = None if signal.is_float else available(use, signal, signal.raw(frames.data))
        if there is not None:
            frames = frames.take(there)
    return frames


def _unseen(message: FrameLayout, names: Sequence[str]) -> list[str]:
    """What of a message is not looked at, where it has more than the columns that are read."""
    others = [name for name in message.signals if name not in names]
    if not others:
        return []
    said = f"{message.name}: not looked at: {', '.join(others)}"
    return [f'{said}; a rig description (rig = "rig.toml") checks CRC, counter and status']


def _values(frames: Frames, message: FrameLayout, name: str) -> Any:
    return frames.t_ns if name == _TIME else message.signals[name].value(frames.data)


def _open(path: Path, layout: FileLayout) -> Source:
    if layout.rig is None:
        return _CanLog(path, layout)
    if layout.dbc is not None:
        raise RefusedError(
            f"{path}, [{layout.table}]", "dbc and rig", expected="one of them: rig names a dbc"
        )
    from triaxcal.rig.check.rigged import RiggedLog  # noqa: PLC0415  the bench takes its time

    return RiggedLog(path, layout.rig)


ENTRY = Format(
    name=CAN_LOG,
    label="a log of CAN frames",
    doc="With `dbc`: a column is a signal, as Message.Signal, in the unit of the bus description. "
    "The axes are signals of one message, whose clock is the time of arrival. J1939's "
    "reserved values are left out, a CRC, a counter and a status are not looked at. With `rig`: "
    "the columns are x, y, z, gyro_x, gyro_y, gyro_z and temperature of a rig description, "
    "which joins several messages and checks CRCs, counters and statuses. ASC, BLF, CSV, MF4 (bus "
    "logging), SQLite, TRC and text of candump, also compressed by gzip.",
    open=_open,
    extensions=(".asc", ".blf", ".trc"),
    package="cantools",
    extra="rig",
)
