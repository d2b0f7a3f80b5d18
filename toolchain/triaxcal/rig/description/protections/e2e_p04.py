"""AUTOSAR E2E profile 4 (PRS E2E Protocol, 6.6)."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import CRC32_P4
from triaxcal.rig.description.protection import Guard, Protection


def _header(guard: Guard, payload: ByteArray) -> tuple[ByteArray, ByteArray]:
    """Length (2,) and Data ID (4,) as they stand before the CRC: high byte first."""
    ends = payload.shape[1].to_bytes(2, "big"), guard.data_ids[0].to_bytes(4, "big")
    length, data_id = (np.frombuffer(part, np.uint8) for part in ends)
    return length, data_id


def _crc(guard: Guard, payload: ByteArray) -> IntArray:
    length, data_id = _header(guard, payload)
    start = guard.place - 8
    same = (payload[:, start : start + 2] == length).all(axis=1)
    same &= (payload[:, start + 4 : start + 8] == data_id).all(axis=1)
    return np.where(same, CRC32_P4.of(guard.covered(payload)), -1)


def _fill(guard: Guard, payload: ByteArray) -> None:
    start = guard.place - 8
    payload[:, start : start + 2], payload[:, start + 4 : start + 8] = _header(guard, payload)


ENTRY = Protection(
    name="e2e-p04",
    label="AUTOSAR E2E profile 4",
    doc="32 bits, behind length, counter and Data ID of 32 bits in a header of 12 bytes.",
    bits=(32,),
    crc=_crc,
    fill=_fill,
    data_ids=1,
    before=8,
    rank=32,
)
