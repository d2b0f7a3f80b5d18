"""Frames of a CAN bus, many at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from triaxcal.model.types import IntArray

UintArray = npt.NDArray[np.uint32]
ByteArray = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]
NameArray = npt.NDArray[np.bytes_]

EFF_FLAG = 0x8000_0000
RTR_FLAG = 0x4000_0000
ERR_FLAG = 0x2000_0000
ID_MASK = 0x1FFF_FFFF
"""Flags beside the ID, as linux/can.h has them: extended ID, remote request, error frame."""

BRS, ESI, SENT = 1, 2, 4
"""Marks of a frame: CAN FD with a switched bit rate; its sender is error passive; sent by the
computer that took it down. Frames without `SENT` were received."""
DLC_SHIFT = 4
"""Above the marks: the data length code 9 to 15 of a classic frame of eight bytes, else 0."""

ERROR_BITS = {
    0x0000_0001: "transmit timeout",
    0x0000_0002: "lost arbitration",
    0x0000_0004: "controller problem",
    0x0000_0008: "protocol violation",
    0x0000_0010: "transceiver problem",
    0x0000_0020: "no acknowledgement",
    0x0000_0040: "bus-off",
    0x0000_0080: "bus error",
    0x0000_0100: "controller restarted",
}
"""Classes of error frames, linux/can/error.h."""
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Payloads that a CAN FD frame may have, bytes."""
BUS_OFF = 0x40
RESTARTED = 0x100


@dataclass(frozen=True)
class Frames:
    """Frames in the order of their arrival.

    Attributes
    ----------
    t_ns : int64 array, shape (n,)
        Time of arrival, ns since 1970.
    can_id : uint32 array, shape (n,)
        ID with the flags above.
    length : uint8 array, shape (n,)
        Bytes of payload; of a remote request, those that it asks for.
    fd : bool array, shape (n,)
        CAN FD frame.
    data : uint8 array, shape (n, 8) or (n, 64)
        Payload, zeros behind its end.
    marks : uint8 array, shape (n,)
        The marks above; zeros where nothing is said.
    channel : array of bytes, shape (n,)
        Name of the channel, ASCII; empty where it is not known.
    texts : tuple of n bytes, or None
        Lines that they were made of, where the source speaks in lines.
    """

    t_ns: IntArray
    can_id: UintArray
    length: ByteArray
    fd: BoolArray
    data: ByteArray
    marks: ByteArray = field(default_factory=lambda: np.zeros(0, np.uint8))
    channel: NameArray = field(default_factory=lambda: np.zeros(0, "S1"))
    texts: tuple[bytes, ...] | None = None

    def __post_init__(self) -> None:
        """Marks and channels of frames that were made without them."""
        for name in ("marks", "channel"):
            column = getattr(self, name)
            if len(column) != len(self.t_ns):
                object.__setattr__(self, name, np.zeros(len(self.t_ns), column.dtype))

    def __len__(self) -> int:
        return len(self.t_ns)

    def take(self, index: slice | BoolArray | IntArray) -> Frames:
        """Some of the frames."""
        some = Frames(*(column[index] for column in self.columns))
        if self.texts is None:
            return some
        places = np.arange(len(self))[index].tolist()
        return replace(some, texts=tuple(self.texts[i] for i in places))

    @property
    def columns(self) -> tuple[Any, ...]:
        """The arrays, in the order of the attributes."""
        return (
            self.t_ns, self.can_id, self.length, self.fd, self.data, self.marks, self.channel
        )  # fmt: skip

    @property
    def flags(self) -> list[BoolArray]:
        """Which have an extended ID, which are remote requests, which are error frames."""
        return [(self.can_id & np.uint32(f)) != 0 for f in (EFF_FLAG, RTR_FLAG, ERR_FLAG)]

    @property
    def is_error(self) -> BoolArray:
        """Which are error frames."""
        return np.asarray((self.can_id & np.uint32(ERR_FLAG)) != 0, np.bool_)


def alike(t_ns: IntArray, can_id: int, length: int, fd: bool, data: ByteArray) -> Frames:
    """Frames of one ID, length and kind: times (n,) and payloads (n, 8) or (n, 64)."""
    count = len(t_ns)
    kinds = np.full(count, length, np.uint8), np.full(count, fd, np.bool_)
    return Frames(t_ns, np.full(count, can_id, np.uint32), *kinds, data)


def without_channel(frames: Frames) -> Frames:
    """Frames of a channel that goes without saying."""
    return replace(frames, channel=np.zeros(len(frames), "S1"))


def empty(width: int = 8) -> Frames:
    """No frames."""
    return alike(np.zeros(0, np.int64), 0, 0, False, np.zeros((0, width), np.uint8))


def concatenate(parts: Sequence[Frames]) -> Frames:
    """Several batches in one, in their order."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return empty()
    width = max(part.data.shape[1] for part in parts)
    wide = [replace(p, data=widened(p.data, width)) for p in parts]
    columns: list[Any] = [np.concatenate(c) for c in zip(*(p.columns for p in wide), strict=True)]
    all_of = Frames(*columns)
    if all(part.texts is None for part in parts):
        return all_of
    return replace(all_of, texts=tuple(text for part in parts for text in part.texts or ()))


def widened(data: ByteArray, width: int) -> ByteArray:
    """Payloads (n, w) with zeros behind, to (n, width)."""
    if data.shape[1] == width:
        return data
    wide = np.zeros((len(data), width), np.uint8)
    wide[:, : data.shape[1]] = data
    return wide


def error_names(can_id: int) -> str:
    """What an error frame says, in words."""
    found = [name for bit, name in ERROR_BITS.items() if can_id & bit]
    return ", ".join(found) or "unknown error"
