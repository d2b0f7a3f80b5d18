"""AUTOSAR E2E profile 1 (PRS E2E Protocol, 6.3)."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.crc import Crc
from triaxcal.rig.description.protection import Guard, Protection

_CRC = Crc(8, 0x1D, 0, 0)
"""SAE J1850's polynomial; the profile undoes the start value and the inversion."""


def _crc(guard: Guard, payload: ByteArray) -> IntArray:
    data_id = guard.data_ids[0]
    low, high = bytes([data_id & 0xFF]), bytes([data_id >> 8])
    if guard.data_id_mode == "nibble":
        crc = _CRC.of(guard.covered(payload, before=low + b"\0"))
        beside = payload[:, guard.place + 1] >> np.uint8(4)
        return np.where(beside == (data_id >> 8) & 0xF, crc, -1)
    if guard.data_id_mode == "alternating":
        assert guard.counter is not None
        odd = (guard.counter.raw(payload) & 1).astype(np.uint8)
        byte = np.where(odd == 1, np.uint8(high[0]), np.uint8(low[0]))
        return _CRC.of(guard.covered(payload, before=byte[:, None]))
    both = guard.data_id_mode == "both"
    return _CRC.of(guard.covered(payload, before=low + high if both else low))


def _fill(guard: Guard, payload: ByteArray) -> None:
    if guard.data_id_mode == "nibble":
        payload[:, guard.place + 1] &= np.uint8(0x0F)
        payload[:, guard.place + 1] |= np.uint8((guard.data_ids[0] >> 8 & 0xF) << 4)


ENTRY = Protection(
    name="e2e-p01",
    label="AUTOSAR E2E profile 1",
    doc="8 bits; Data ID of 16 bits by data_id_mode, counter from 0 to 14.",
    bits=(8,),
    crc=_crc,
    fill=_fill,
    counter_modulus=15,
    data_ids=1,
    rank=30,
)
