"""Messages of a bus description: which frames are of a message, and where its signals lie."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import (
    EFF_FLAG,
    ERR_FLAG,
    FD_LENGTHS,
    ID_MASK,
    RTR_FLAG,
    BoolArray,
    ByteArray,
    UintArray,
)
from triaxcal.rig.description.signals import Signal

if TYPE_CHECKING:
    from cantools.database.can import Message
    from cantools.database.can import Signal as CanSignal

_FLAGS = EFF_FLAG | RTR_FLAG | ERR_FLAG
WHOLE_ID = _FLAGS | ID_MASK
_PDU2 = 240
"""PDU format from which a PGN is sent to all: its second byte belongs to the PGN (J1939-21)."""
_NO_VALUE = re.compile(
    r"^na$|(?<!no)(?:sna|notavailable|unavailable|invalid|notvalid|error|errorindicator|fault|failure"
    r"|undefined)$"
)
"""Ends of the names of values that are none, lower case, letters and digits alone."""
ANY_SOURCE = 0xFE
"""J1939's null address; descriptions state it where the source address is left open."""


@dataclass(frozen=True)
class Condition:
    """A multiplexer's raw values with which something is in the payload."""

    selector: Signal
    values: tuple[int, ...]

    def holds(self, data: ByteArray) -> BoolArray:
        """Which of the payloads (n, bytes) it holds for."""
        return np.isin(self.selector.raw(data), self.values)


@dataclass(frozen=True)
class FrameLayout:
    """Layout of one message.

    Attributes
    ----------
    frame_id : int
        ID without flags.
    size : int
        Bytes of payload.
    signals : mapping
        By name.
    extended : bool
        29-bit ID.
    j1939 : bool
        The ID is a priority, a PGN and a source address.
    fd_stated : bool
        The description says itself that it is CAN FD; of others the length does.
    multiplexed : mapping
        By name of a signal, what must hold for it to be in the payload; absent where it always is.
    """

    name: str
    frame_id: int
    size: int
    fd: bool
    signals: Mapping[str, Signal]
    extended: bool = False
    j1939: bool = False
    fd_stated: bool = False
    multiplexed: Mapping[str, tuple[Condition, ...]] = field(
        default_factory=lambda: MappingProxyType({})
    )

    @property
    def can_id(self) -> int:
        """ID with its flag, as frames have it."""
        return self.frame_id | (EFF_FLAG if self.extended else 0)

    @property
    def source_address(self) -> int:
        """J1939's source address."""
        return self.frame_id & 0xFF

    @cached_property
    def mask(self) -> int:
        """Bits of a frame's ID with flags that must be those of `can_id`.

        Of J1939 all but the priority, of a PGN for one destination all but the destination, and
        all but the source address where the description leaves it open.
        """
        if not self.j1939:
            return WHOLE_ID
        source = 0 if self.source_address == ANY_SOURCE else 0xFF
        destination = 0xFF00 if (self.frame_id >> 16) & 0xFF >= _PDU2 else 0
        return _FLAGS | 0x03FF_0000 | destination | source

    @cached_property
    def sent_bytes(self) -> int:
        """Bytes of payload on the bus: CAN FD has not every length."""
        return next((n for n in FD_LENGTHS if n >= self.size), self.size)

    def mine(self, can_id: UintArray) -> BoolArray:
        """Which of the IDs with flags are of this message."""
        mask = self.mask
        if mask == WHOLE_ID:
            return np.asarray(can_id == np.uint32(self.can_id), np.bool_)
        return np.asarray((can_id & np.uint32(mask)) == np.uint32(self.can_id & mask), np.bool_)

    def overlaps(self, other: FrameLayout) -> bool:
        """Whether a frame could be of both messages."""
        common = self.mask & other.mask
        return (self.can_id ^ other.can_id) & common == 0

    def raw(self, signal: str, data: ByteArray) -> IntArray:
        """Raw integers of one signal of payloads (n, bytes); shape (n,)."""
        return self.signals[signal].raw(data)


def layout_of(message: Message) -> FrameLayout:
    """Layout of any message of a cantools database."""
    signals = {
        s.name: Signal(
            s.name,
            s.start,
            s.length,
            s.byte_order == "little_endian",
            s.is_signed,
            s.scale,
            s.offset,
            s.is_float,
            s.unit or "",
            _no_values(s),
        )
        for s in message.signals
    }
    return FrameLayout(
        name=message.name,
        frame_id=message.frame_id,
        size=message.length,
        fd=bool(message.is_fd) or message.length > 8,
        signals=MappingProxyType(signals),
        extended=message.is_extended_frame,
        j1939=message.protocol == "j1939",
        fd_stated=bool(message.is_fd),
        multiplexed=MappingProxyType(
            {
                s.name: _conditions(message, s.name, signals)
                for s in message.signals
                if s.multiplexer_signal
            }
        ),
    )


def _no_values(signal: CanSignal) -> tuple[tuple[int, str], ...]:
    """Raw integers whose names (VAL_) say that there is no value."""
    if signal.is_float:
        return ()
    named = ((int(raw), str(name)) for raw, name in (signal.choices or {}).items())
    return tuple(
        (raw, name)
        for raw, name in sorted(named)
        if _NO_VALUE.search("".join(c for c in name.lower() if c.isalnum()))
    )


def _conditions(
    message: Message, name: str, signals: Mapping[str, Signal]
) -> tuple[Condition, ...]:
    """Conditions of a multiplexed signal, those of its selectors included."""
    found: list[Condition] = []
    signal = message.get_signal_by_name(name)
    while signal.multiplexer_signal:
        selector = signals[signal.multiplexer_signal]
        found.append(Condition(selector, tuple(sorted(signal.multiplexer_ids or ()))))
        signal = message.get_signal_by_name(signal.multiplexer_signal)
    return tuple(reversed(found))
