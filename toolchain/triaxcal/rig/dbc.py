"""The rig's DBC: read through cantools, checked, turned into layouts for whole columns."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import cantools
import numpy as np
from cantools.database import Database
from cantools.database.can import Message

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.model.types import IntArray
from triaxcal.rig.e2e import frame_crc
from triaxcal.rig.frames import BoolArray, ByteArray, Frames, alike, widened
from triaxcal.rig.signals import Signal

REQUIRED = MappingProxyType(
    {
        "RIG_XY": ("Crc", "Sequence", "AccelX", "AccelY"),
        "RIG_Z": ("Crc", "Sequence", "AccelZ", "TimeUs", "Status"),
        "RIG_TEMP": ("Crc", "Sequence", "TempCode", "Status"),
        "RIG_IDENT": ("Crc", "Sequence", "SerialCrc", "RateHz"),
        "RIG_FD": (
            "Crc", "Sequence", "Status", "TimeUs", "AccelX", "AccelY", "AccelZ", "TempCode",
            "SerialCrc", "RateHz",
        ),
        "COMP_X": ("Crc", "Sequence", "Accel", "Status"),
        "COMP_Y": ("Crc", "Sequence", "Accel", "Status"),
        "COMP_Z": ("Crc", "Sequence", "Accel", "Status"),
    }
)  # fmt: skip
"""Messages that the bench needs, and their signals."""


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
    """

    name: str
    frame_id: int
    size: int
    fd: bool
    signals: MappingProxyType[str, Signal]

    def raw(self, signal: str, data: ByteArray) -> IntArray:
        """Raw integers of one signal of payloads (n, bytes); shape (n,)."""
        return self.signals[signal].raw(data)

    def valid(self, frames: Frames) -> BoolArray:
        """Which of the frames, all of this ID, have the right length, kind and CRC."""
        good: BoolArray = (frames.length == self.size) & (frames.fd == self.fd)
        if not good.any():
            return good
        payload = frames.data[:, : self.size]
        crc = self.signals["Crc"]
        good &= crc.raw(payload) == frame_crc(self.frame_id, payload, crc.length)
        return good

    def pack(self, values: dict[str, IntArray]) -> ByteArray:
        """Payloads (n, size) of raw integers (n,) by signal, CRC added."""
        count = len(next(iter(values.values())))
        data = np.zeros((count, self.size), np.uint8)
        for name, raw in values.items():
            self.signals[name].put(data, raw)
        crc = self.signals["Crc"]
        crc.put(data, frame_crc(self.frame_id, data, crc.length))
        return data

    def frames(self, values: dict[str, IntArray], t_ns: IntArray) -> Frames:
        """Frames of times (n,) with the payloads of `pack`."""
        data = widened(self.pack(values), 64 if self.fd else 8)
        return alike(t_ns, self.frame_id, self.size, self.fd, data)


@dataclass(frozen=True)
class RigDbc:
    """The rig's frames.

    Attributes
    ----------
    messages : mapping
        Layouts by name of message.
    sha256 : str
        Of the DBC file.
    """

    path: Path
    sha256: str
    messages: MappingProxyType[str, FrameLayout]


def default_dbc() -> Path:
    """The tilter.dbc that came with triaxcal."""
    return shipped("rig") / "tilter.dbc"


def read_dbc(path: Path) -> RigDbc:
    """Read and check a DBC.

    Raises
    ------
    RefusedError
        When the file cannot be read, is no DBC, or lacks a message or a signal that the bench
        needs; all that are missing are named at once.
    """
    database = load_database(path)
    layouts: dict[str, FrameLayout] = {}
    missing = []
    for name, signals in REQUIRED.items():
        message = next((m for m in database.messages if m.name == name), None)
        if message is None:
            missing.append(f"message {name}")
            continue
        layouts[name] = layout_of(message)
        missing += [f"signal {name}.{s}" for s in signals if s not in layouts[name].signals]
    if missing:
        raise RefusedError(
            str(path),
            "missing: " + ", ".join(missing),
            expected="the messages of rig/tilter.dbc",
            remedy="use the DBC of this rig",
        )
    _refuse_unprotected(path, layouts)
    return RigDbc(path, hashlib.sha256(path.read_bytes()).hexdigest(), MappingProxyType(layouts))


def load_database(path: Path) -> Database:
    """Any DBC, as cantools has it.

    Raises
    ------
    RefusedError
        When the file cannot be read or is no DBC.
    """
    try:
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise RefusedError(str(path), f"cannot be read: {error.strerror}") from error
    try:
        return cantools.database.can.Database(strict=True) if not text.strip() else _parsed(text)
    except Exception as error:  # cantools raises its parser's and its own errors, of many types
        raise RefusedError(str(path), f"not a DBC: {error}") from error


def _parsed(text: str) -> Database:
    database = cantools.database.can.Database()
    database.add_dbc_string(text)
    return database


def layout_of(message: Message) -> FrameLayout:
    """Layout of any message of a cantools database; of multiplexed signals each separately."""
    return FrameLayout(
        name=message.name,
        frame_id=message.frame_id,
        size=message.length,
        fd=bool(message.is_fd),
        signals=MappingProxyType(
            {
                s.name: Signal(
                    s.name,
                    s.start,
                    s.length,
                    s.byte_order == "little_endian",
                    s.is_signed,
                    float(s.scale),
                    float(s.offset),
                )
                for s in message.signals
            }
        ),
    )


def _refuse_unprotected(path: Path, layouts: dict[str, FrameLayout]) -> None:
    for layout in layouts.values():
        crc = layout.signals["Crc"]
        wanted = 32 if layout.fd else 8
        if crc.start != 0 or crc.length != wanted or not crc.little_endian:
            raise RefusedError(
                f"{path}, {layout.name}.Crc",
                f"bits {crc.start} to {crc.start + crc.length - 1}",
                expected=f"bits 0 to {wanted - 1}: the CRC comes first",
            )
