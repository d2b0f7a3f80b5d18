"""AUTOSAR E2E profile 2 (PRS E2E Protocol, 6.4)."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import CRC8_2F
from triaxcal.rig.description.protection import Guard, Protection


def _crc(guard: Guard, payload: ByteArray) -> IntArray:
    assert guard.counter is not None
    ids = np.array(guard.data_ids, np.uint8)
    return CRC8_2F.of(guard.covered(payload, after=ids[guard.counter.raw(payload) & 0xF][:, None]))


ENTRY = Protection(
    name="e2e-p02",
    label="AUTOSAR E2E profile 2",
    doc="8 bits; a list of 16 Data IDs of 8 bits, chosen by the counter of 4 bits.",
    bits=(8,),
    crc=_crc,
    data_ids=16,
    rank=31,
)
