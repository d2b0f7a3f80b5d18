"""AUTOSAR E2E profile 5 (PRS E2E Protocol, 6.7)."""

from __future__ import annotations

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import CRC16_CCITT
from triaxcal.rig.description.protection import Guard, Protection


def _crc(guard: Guard, payload: ByteArray) -> IntArray:
    return CRC16_CCITT.of(guard.covered(payload, after=guard.data_ids[0].to_bytes(2, "little")))


ENTRY = Protection(
    name="e2e-p05",
    label="AUTOSAR E2E profile 5",
    doc="16 bits; Data ID of 16 bits, not sent, counter of 8 bits.",
    bits=(16,),
    crc=_crc,
    data_ids=1,
    rank=33,
)
