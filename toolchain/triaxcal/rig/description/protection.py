"""End-to-end protection of payloads: what a CRC in a message covers, and the registry of the ways.

A CRC signal is compared as a number: the byte order in which it is sent is the bus description's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from triaxcal.base.registry import Registry
from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import Crc
from triaxcal.rig.description.signals import Signal

DATA_ID_MODES = ("both", "alternating", "low", "nibble")
"""Which bytes of its Data ID AUTOSAR's profile 1 covers."""


@dataclass(frozen=True)
class Guard:
    """The CRC of one message and what it is made with.

    Attributes
    ----------
    signal : Signal
        The CRC, whole bytes.
    frame_id : int
        Of the message, without flags.
    counter : Signal or None
        Of the message.
    data_ids : tuple of int
        AUTOSAR's Data ID, or the list of them.
    data_id_mode : str
        One of `DATA_ID_MODES`.
    """

    signal: Signal
    frame_id: int
    counter: Signal | None = None
    data_ids: tuple[int, ...] = ()
    data_id_mode: str = "both"

    @property
    def place(self) -> int:
        """First byte of the CRC."""
        return self.signal.first_byte

    @property
    def byte_count(self) -> int:
        """Bytes of the CRC."""
        return self.signal.length // 8

    def covered(
        self, payload: ByteArray, before: bytes | ByteArray = b"", after: bytes | ByteArray = b""
    ) -> ByteArray:
        """Payloads (n, bytes) without the CRC, between other bytes: the same, or (n, k)."""
        first, count = _rows(before), _rows(after)
        head, tail = first.shape[1], count.shape[1]
        end = self.place + self.byte_count
        made = np.empty((len(payload), head + payload.shape[1] - self.byte_count + tail), np.uint8)
        made[:, :head] = first
        made[:, head : head + self.place] = payload[:, : self.place]
        made[:, head + self.place : made.shape[1] - tail] = payload[:, end:]
        made[:, made.shape[1] - tail :] = count
        return made


def _rows(some: bytes | ByteArray) -> ByteArray:
    return np.frombuffer(some, np.uint8)[None] if isinstance(some, bytes) else some


def _nothing(_: Guard, payload: ByteArray) -> None:
    """Protection without a header of its own."""


@dataclass(frozen=True)
class Protection:
    """A way of protection: an entry of `PROTECTIONS`.

    Attributes
    ----------
    name, label, doc : str
        Name in rig.toml; in reports; what it covers.
    bits : tuple of int
        Lengths that the CRC may have.
    crc : callable
        CRC of payloads (n, bytes), shape (n,); -1 where what stands beside it is wrong.
    fill : callable
        Writes what stands beside it into payloads (n, bytes), for the simulated rig.
    counter_modulus : int
        Of its counter; 0 where it is that of the counter's bits.
    data_ids : int
        Data IDs that it needs.
    before : int
        Bytes before the CRC that belong to it.
    """

    name: str
    label: str
    doc: str
    bits: tuple[int, ...]
    crc: Callable[[Guard, ByteArray], IntArray]
    fill: Callable[[Guard, ByteArray], None] = _nothing
    counter_modulus: int = 0
    data_ids: int = 0
    before: int = 0
    rank: int = 100


PROTECTIONS = Registry("protection", "triaxcal.rig.description.protections", Protection, ("bits",))


def plain(name: str, label: str, crc: Crc, what: str, rank: int) -> Protection:
    """Protection by one CRC of all other bytes of the payload."""
    return Protection(
        name=name,
        label=label,
        doc=f"{what}; it covers all other bytes of the payload.",
        bits=(crc.bits,),
        crc=lambda guard, payload: crc.of(guard.covered(payload)),
        rank=rank,
    )
