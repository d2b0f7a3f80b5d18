"""The tilter's own frames: a CRC of AUTOSAR over the ID and the payload."""

from __future__ import annotations

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import CRC8_2F, CRC32_P4
from triaxcal.rig.description.protection import Guard, Protection


def _crc(guard: Guard, payload: ByteArray) -> IntArray:
    """CRC with the ID, low byte first: a frame under the wrong ID fails too."""
    covered = guard.covered(payload, before=(guard.frame_id & 0xFFFF).to_bytes(2, "little"))
    return (CRC8_2F if guard.signal.length == 8 else CRC32_P4).of(covered)


ENTRY = Protection(
    name="tilter",
    label="CRC of the tilter",
    doc="8 bits: CRC-8H2F, 32 bits: CRC-32P4; it covers the low 16 bits of the ID, low byte first, "
    "and all other bytes of the payload.",
    bits=(8, 32),
    crc=_crc,
    rank=10,
)
