"""The frames of our own node: what the generated C speaks in `triaxcal rig fil`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray, ByteArray, Frames, alike, widened
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.description import MessageUse
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.protection import PROTECTIONS, Guard
from triaxcal.rig.description.rows import is_good

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
"""Messages that the node needs, and their signals."""
OF_ANGLES = MappingProxyType(
    dict.fromkeys(("COMP_ANGLE_0", "COMP_ANGLE_1"), ("Crc", "Sequence", "Angle", "Status"))
)
"""Those of a node that gives angles too."""


@dataclass(frozen=True)
class NodeFrame(FrameLayout):
    """Layout of one message of the node, whose CRC comes first."""

    @property
    def use(self) -> MessageUse:
        """The message with its CRC."""
        guard = Guard(self.signals["Crc"], self.frame_id)
        return MessageUse(self, guard=guard, protection=PROTECTIONS["tilter"])

    def valid(self, frames: Frames) -> BoolArray:
        """Which of the frames, all of this ID, have the right length, kind and CRC."""
        return is_good(self.use, frames.length, frames.fd, frames.data)

    def pack(self, values: Mapping[str, IntArray]) -> ByteArray:
        """Payloads (n, size) of raw integers (n,) by signal, CRC added."""
        count = len(next(iter(values.values())))
        data = np.zeros((count, self.size), np.uint8)
        for name, raw in values.items():
            self.signals[name].put(data, raw)
        guard = Guard(self.signals["Crc"], self.frame_id)
        guard.signal.put(data, PROTECTIONS["tilter"].crc(guard, data))
        return data

    def frames(self, values: Mapping[str, IntArray], t_ns: IntArray) -> Frames:
        """Frames of times (n,) with the payloads of `pack`."""
        data = widened(self.pack(values), 64 if self.fd else 8)
        return alike(t_ns, self.frame_id, self.size, self.fd, data)


@dataclass(frozen=True)
class RigDbc:
    """The node's frames.

    Attributes
    ----------
    messages : mapping
        Layouts by name of message.
    sha256 : str
        Of the DBC file.
    """

    path: Path
    sha256: str
    messages: Mapping[str, NodeFrame]


def default_dbc() -> Path:
    """The tilter.dbc that came with triaxcal."""
    return shipped("rig") / "tilter.dbc"


def read_dbc(path: Path, *, angles: bool = False) -> RigDbc:
    """Read and check the DBC of a node, of one that gives `angles` or does not.

    Raises
    ------
    RefusedError
        When the file cannot be read, is no DBC, or lacks a message or a signal that the node
        needs; all that are missing are named at once.
    """
    file = read_bus_file(path)
    found = {layout.name: layout for layout in file.layouts()}
    required = {**REQUIRED, **(OF_ANGLES if angles else {})}
    missing = [f"message {name}" for name in required if name not in found]
    missing += [
        f"signal {name}.{s}"
        for name, signals in required.items()
        if name in found
        for s in signals
        if s not in found[name].signals
    ]
    if missing:
        raise RefusedError(
            str(path),
            "missing: " + ", ".join(missing),
            expected="the messages of rig/tilter.dbc",
            remedy="use the DBC of this node",
        )
    frames = {name: NodeFrame(**vars(found[name])) for name in required}
    for frame in frames.values():
        _refuse_unprotected(path, frame)
    return RigDbc(path, file.sha256, MappingProxyType(frames))


def _refuse_unprotected(path: Path, frame: NodeFrame) -> None:
    crc = frame.signals["Crc"]
    wanted = 32 if frame.fd else 8
    if crc.start != 0 or crc.length != wanted or not crc.little_endian:
        raise RefusedError(
            f"{path}, {frame.name}.Crc",
            f"bits {crc.start} to {crc.start + crc.length - 1}",
            expected=f"bits 0 to {wanted - 1}: the CRC comes first",
        )
