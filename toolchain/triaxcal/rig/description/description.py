"""The rig description, rig.toml: which signals of which bus are x, y, z and the temperature.

The seam: `rigfile.read_description` gives a `RigDescription`, which is data only. Whatever decodes
(`samples.SampleDecoder`), simulates (`simframes.FrameMaker`) or checks reads that alone; nothing
else in the bench knows a message by its name. A description is made once and shared; a decoder of
its own for each unit costs some kilobytes. `moved` gives the description of another unit of the
same make on the same bus, by the offset of its IDs or by its J1939 source address.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray, ByteArray, Frames
from triaxcal.rig.description.layout import Condition, FrameLayout
from triaxcal.rig.description.lines import LineFormat
from triaxcal.rig.description.protection import Guard, Protection
from triaxcal.rig.description.recorded import Recorded, SignalUnit
from triaxcal.rig.description.signals import Signal

_HALF, _LOW = 16, 0xFFFF
"""Half of a counter's bits, 32 at most."""


@dataclass(frozen=True)
class Status:
    """A status or validity signal, and its raw values that are good."""

    signal: Signal
    good: tuple[int, ...] = (0,)


def on_channel(frames: Frames, channel: str) -> BoolArray:
    """Which of the frames came on a channel, or on none that is known."""
    mine: BoolArray = (frames.channel == channel.encode()) | (frames.channel == b"")
    return mine


@dataclass(frozen=True)
class MessageUse:
    """One message that the bench reads.

    Attributes
    ----------
    layout : FrameLayout
    counter : Signal or None
    counter_modulus, counter_step : int
        Number of the counter's values; what it grows by from frame to frame.
    guard, protection : Guard and Protection, or None
        The CRC, and how it is made.
    statuses : tuple of Status
        Each must be good.
    only : tuple of Condition
        Frames of the message for which these do not hold are not looked at.
    channel : str or None
        Channel that its frames come on, where there are several; None: any.
    """

    layout: FrameLayout
    counter: Signal | None = None
    counter_modulus: int = 0
    counter_step: int = 1
    guard: Guard | None = None
    protection: Protection | None = None
    statuses: tuple[Status, ...] = ()
    only: tuple[Condition, ...] = ()
    channel: str | None = None

    @property
    def name(self) -> str:
        """Name of the message."""
        return self.layout.name

    def mine(self, frames: Frames) -> BoolArray:
        """Which of the frames are of this message, by ID and channel.

        Frames of no channel are of any.
        """
        mine = self.layout.mine(frames.can_id)
        return mine if self.channel is None else mine & on_channel(frames, self.channel)

    def overlaps(self, other: MessageUse) -> bool:
        """Whether a frame could be of both messages."""
        apart = None not in {self.channel, other.channel} and self.channel != other.channel
        return not apart and self.layout.overlaps(other.layout)

    @property
    def turn(self) -> int:
        """Frames after which the counter has the same value again; 0 without a counter."""
        return self.counter_modulus // self._divisor if self.counter is not None else 0

    def sequence(self, data: ByteArray) -> IntArray:
        """Number of each frame (n,) by the counter, modulo `turn`: it grows by 1 a frame."""
        assert self.counter is not None
        raw = self.counter.raw(data)
        if self.counter_step == 1:
            return raw
        # Steps of s modulo m: (raw / g) (s / g)^-1 modulo m / g, where g divides both.
        turn = self.turn
        back, steps = pow(self.counter_step // self._divisor, -1, turn), raw // self._divisor
        high = (steps >> _HALF) * back % turn  # in two halves: a product of 64 bits has no room
        return np.asarray(((high << _HALF) + (steps & _LOW) * back) % turn, np.int64)

    @property
    def _divisor(self) -> int:
        return math.gcd(self.counter_step, self.counter_modulus)

    def moved(self, frame_id: int) -> MessageUse:
        """The same under another ID."""
        guard = self.guard and replace(self.guard, frame_id=frame_id)
        return replace(self, layout=replace(self.layout, frame_id=frame_id), guard=guard)


@dataclass(frozen=True)
class SampleTime:
    """Time of a sample by the unit's own clock."""

    signal: SignalUnit
    tick_us: float

    @property
    def turn(self) -> int:
        """Steps after which it is 0 again."""
        return 1 << self.signal.signal.length


@dataclass(frozen=True)
class RigDescription:
    """What a rig sends, resolved.

    Attributes
    ----------
    name : str
        Of a shipped description, else the path of rig.toml.
    sha256, bus_sha256 : str
        Of rig.toml, and of the bus description.
    bus_files : tuple of Path
        The first is the rig's.
    messages : mapping
        Those that are read, by name: of the axes in the order x, y, z, of gyros, then the others.
    axes : tuple of three Recorded
    gyros : tuple of Recorded
        Rates about x, y, z of an IMU, which a sample has besides; empty where there are none.
    temperature : Recorded or None
    join : str
        "counter", "age", or "" where one frame has all axes.
    age_s : float
        Greatest age of an axis, where they are joined by age.
    sample_at : str
        Message whose arrival makes a sample.
    warnings : tuple of str
        What breaks the letter of the bus description's format.
    lines : LineFormat or None
        Format of the lines that it sends in place of frames.
    """

    name: str
    sha256: str
    bus_files: tuple[Path, ...]
    bus_sha256: str
    messages: Mapping[str, MessageUse]
    axes: tuple[Recorded, Recorded, Recorded]
    temperature: Recorded | None = None
    sample_time: SampleTime | None = None
    serial: SignalUnit | None = None
    serial_is: str = "crc32"
    rate: SignalUnit | None = None
    join: str = ""
    age_s: float = 0.0
    sample_at: str = ""
    warnings: tuple[str, ...] = field(default=())
    gyros: tuple[Recorded, ...] = ()
    lines: LineFormat | None = None

    @property
    def bus_file(self) -> Path:
        """Bus description of the rig."""
        return self.bus_files[0]

    @property
    def fd(self) -> bool:
        """Whether any of its frames is CAN FD."""
        return any(use.layout.fd for use in self.messages.values())

    def hears(self, frames: Frames) -> BoolArray:
        """Which of the frames come on a channel of the rig."""
        channels = {use.channel for use in self.messages.values()}
        every = np.ones(len(frames), np.bool_)
        if None in channels:
            return every
        for channel in channels:
            every &= ~on_channel(frames, str(channel))
        return ~every

    @property
    def axis_messages(self) -> tuple[str, ...]:
        """Messages of the axes and gyros, each once."""
        return tuple(dict.fromkeys(axis.message for axis in self.sampled))

    @property
    def sampled(self) -> tuple[Recorded, ...]:
        """What a sample has: axes, then gyros."""
        return (*self.axes, *self.gyros)

    def moved(self, id_offset: int = 0, source_address: int | None = None) -> RigDescription:
        """Description of another unit of this make.

        Parameters
        ----------
        id_offset : int
            Added to the IDs that are not J1939's.
        source_address : int, optional
            Of the IDs that are J1939's.
        """
        moved = {}
        for name, use in self.messages.items():
            frame_id = use.layout.frame_id
            if not use.layout.j1939:
                moved[name] = use.moved(frame_id + id_offset)
            elif source_address is not None:
                moved[name] = use.moved((frame_id & ~0xFF) | source_address)
            else:
                moved[name] = use
        return replace(self, messages=moved)
