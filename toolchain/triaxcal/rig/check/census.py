"""Frames of each message that a rig description reads, counted: how many fit it, and why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import EFF_FLAG, ERR_FLAG, ID_MASK, RTR_FLAG, Frames
from triaxcal.rig.description.description import MessageUse, RigDescription
from triaxcal.rig.description.rows import rows_of, status_of

_NEAR = 6
"""IDs that are named where a message has no frame."""
_STEPS_MIN = 8
"""Steps of a counter from which on something is said of it."""
_STEADY = 0.9
"""Share of a counter's steps that are 1 where frames are not lost all the time."""
_PGN = 0x03FF_FF00
_PGN_TO_ONE = 0x03FF_0000
_TO_ALL = 240
"""PDU format from which a PGN is sent to all (J1939-21)."""


@dataclass
class _Count:
    """Frames of one message."""

    use: MessageUse
    frames: int = 0
    good: int = 0
    kinds: Counter[tuple[int, bool]] = field(default_factory=Counter)
    bad_crc: int = 0
    bad_status: int = 0
    first_status: int = 0
    steps: Counter[int] = field(default_factory=Counter)
    wraps: Counter[tuple[int, int]] = field(default_factory=Counter)
    last: int | None = None

    def add(self, frames: Frames) -> None:
        """Count those of one more piece."""
        layout = self.use.layout
        mine = frames.take(self.use.mine(frames))
        self.frames += len(mine)
        fits = (mine.length == layout.sent_bytes) & (mine.fd == layout.fd)
        if not fits.all():
            odd = zip(mine.length[~fits].tolist(), mine.fd[~fits].tolist(), strict=True)
            self.kinds.update(odd)
        rows, bad = rows_of(self.use, mine, 0)
        self.good += len(rows)
        self.bad_crc += len(bad) - int((~fits).sum())
        status = status_of(self.use, rows.data)
        if status is not None and status.any():
            self.first_status = self.first_status or int(status[status != 0][0])
            self.bad_status += int((status != 0).sum())
        if self.use.counter is not None and len(rows):
            self._count(self.use.counter.raw(rows.data))

    def _count(self, counter: IntArray) -> None:
        if self.last is not None:
            counter = np.concatenate([[self.last], counter])
        self.last = int(counter[-1])
        step = np.diff(counter)
        values, counts = np.unique(step[step >= 0], return_counts=True)
        self.steps.update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
        back = np.flatnonzero(step < 0)
        self.wraps.update(zip(counter[back].tolist(), counter[back + 1].tolist(), strict=True))

    def faults(self) -> Iterator[str]:
        """What does not fit the description."""
        layout, frames = self.use.layout, self.frames
        name = f"{layout.name} (ID 0x{layout.frame_id:X})"
        for (length, fd), count in self.kinds.most_common():
            yield (
                f"{name}: {count} of {frames} frames have {_kind(length, fd)}, not "
                f"{_kind(layout.sent_bytes, layout.fd)} as described"
            )
        if self.bad_crc and self.use.protection is not None:
            yield (
                f"{name}: {self.bad_crc} of {frames} frames have a wrong CRC "
                f"({self.use.protection.label})"
            )
        if self.bad_status:
            yield (
                f"{name}: {self.bad_status} of {frames} frames have a status that is not good "
                f"(0x{self.first_status:X} beside it)"
            )
        if text := self._of_counter():
            yield f"{name}: {text}"

    def _of_counter(self) -> str:
        """Why a counter is none, or has another modulus; "" where it counts."""
        counter, turns = self.use.counter, self.wraps.total()
        total = self.steps.total() + turns
        if counter is None or total < _STEPS_MIN:
            return ""
        if self.steps[0] == total:
            return (
                f"{counter.name} never counts, it is always {self.last}: it is another signal, "
                "or `counter` of rig.toml is to be left out"
            )
        step, often = self.steps.most_common(1)[0]
        if step and step != self.use.counter_step and often >= _STEADY * self.steps.total():
            return (
                f"{counter.name} grows by {step} from frame to frame, and "
                f"{self.use.counter_step} is described: counter_step = {step} in rig.toml"
            )
        if turns < 2 or step != 1 or often < _STEADY * self.steps.total():
            return ""
        (high, low), count = self.wraps.most_common(1)[0]
        described = self.use.counter_modulus
        if count < _STEADY * turns or low or high + 1 == described:
            return ""
        return (
            f"{counter.name} counts from 0 to {high}, and 0 to {described - 1} is described: "
            f"counter_modulus = {high + 1} in rig.toml"
        )


def _kind(length: int, fd: bool) -> str:
    return f"{length} bytes of {'CAN FD' if fd else 'classic CAN'}"


class Census:
    """Frames counted by the messages of a rig description.

    Attributes
    ----------
    frames : int
        All that came.
    """

    def __init__(self, rig: RigDescription) -> None:
        self.frames = 0
        self._counts = [_Count(use) for use in rig.messages.values()]
        self._ids: Counter[int] = Counter()
        self._rig = rig
        self._others: Counter[bytes] = Counter()

    def add(self, frames: Frames) -> None:
        """Count those of one more piece."""
        self.frames += len(frames)
        heard = self._rig.hears(frames)
        if not heard.all():
            self._others.update(frames.channel[~heard].tolist())
            frames = frames.take(heard)
        ids, counts = np.unique(frames.can_id, return_counts=True)
        self._ids.update(dict(zip(ids.tolist(), counts.tolist(), strict=True)))
        for count in self._counts:
            count.add(frames)

    def faults(self) -> list[str]:
        """What does not fit the description, a sentence each, what is missing first."""
        missing = [self._missing(count.use) for count in self._counts if not count.frames]
        if missing and self._others:
            there = ", ".join(
                f"{n.decode('ascii', 'replace')} ({c})" for n, c in self._others.items()
            )
            missing.insert(
                0, f"channel {self._channels} of rig.toml is read; frames came on {there}"
            )
        return [*missing, *(text for count in self._counts for text in count.faults())]

    @property
    def _channels(self) -> str:
        return ", ".join(sorted({str(use.channel) for use in self._rig.messages.values()}))

    def said(self) -> list[str]:
        """Frames of each message, and how many are good."""
        return [
            f"{count.use.layout.name} (ID 0x{count.use.layout.frame_id:X}): {count.frames} frames, "
            f"{count.good} good"
            for count in self._counts
        ]

    def _missing(self, use: MessageUse) -> str:
        """A message without a frame, and what came in its place."""
        layout = use.layout
        name = f"{layout.name} (ID 0x{layout.frame_id:X})"
        ids = np.array([i for i in self._ids if not i & ERR_FLAG], np.uint32)
        ours = np.logical_or.reduce([count.use.layout.mine(ids) for count in self._counts])
        strange = {i: self._ids[i] for i in ids[~ours].tolist()}
        twins = [i for i in strange if i & ID_MASK == layout.frame_id]
        if any(i & RTR_FLAG for i in twins):
            return f"{name}: no frame, only remote requests"
        if twins:
            bits = "29" if twins[0] & EFF_FLAG else "11"
            return f"{name}: no frame; {strange[twins[0]]} have this number as an ID of {bits} bits"
        if layout.j1939:
            pgn = _PGN if (layout.frame_id >> 16) & 0xFF >= _TO_ALL else _PGN_TO_ONE
            same = [i for i in strange if i & EFF_FLAG and not (i ^ layout.frame_id) & pgn]
            if same:
                sent = ", ".join(sorted({f"0x{i & 0xFF:02X}" for i in same}))
                return (
                    f"{name}: no frame from source address 0x{layout.source_address:02X}; its PGN "
                    f"comes from {sent}: source_address in rig.toml"
                )
        if not strange:
            return f"{name}: no frame"
        near = sorted(strange, key=lambda i: abs((i & ID_MASK) - layout.frame_id))[:_NEAR]
        seen = ", ".join(f"0x{i & ID_MASK:X} ({strange[i]})" for i in near)
        return f"{name}: no frame; other IDs that came, the nearest first: {seen}"
