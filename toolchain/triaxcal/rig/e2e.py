"""End-to-end protection of the rig's frames, after AUTOSAR E2E.

Classic frames carry CRC-8H2F (polynomial 0x2F, start 0xFF, inverted), the CAN FD frame CRC-32P4
(polynomial 0xF4ACFB13, reflected, start 0xFFFFFFFF, inverted): AUTOSAR, Specification of CRC
Routines. Either runs over the frame's 11-bit ID (low byte, high byte) and the payload without
the CRC's own bytes, so that a frame under the wrong ID fails too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from triaxcal.rig.frames import ByteArray, UintArray


def _table_8() -> ByteArray:
    table = np.zeros(256, np.uint8)
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x2F if crc & 0x80 else crc << 1
        table[byte] = crc & 0xFF
    return table


def _table_32() -> UintArray:
    reflected = int(f"{0xF4ACFB13:032b}"[::-1], 2)
    table = np.zeros(256, np.uint32)
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc >> 1) ^ reflected if crc & 1 else crc >> 1
        table[byte] = crc
    return table


_TABLE_8 = _table_8()
_TABLE_32 = _table_32()


def crc8(data: ByteArray) -> ByteArray:
    """CRC-8H2F of each row of (n, bytes); shape (n,)."""
    crc = np.full(len(data), 0xFF, np.uint8)
    for column in range(data.shape[1]):
        crc = _TABLE_8[crc ^ data[:, column]]
    return crc ^ np.uint8(0xFF)


def crc32p4(data: ByteArray) -> UintArray:
    """CRC-32P4 of each row of (n, bytes); shape (n,)."""
    crc = np.full(len(data), 0xFFFFFFFF, np.uint32)
    for column in range(data.shape[1]):
        crc = _TABLE_32[(crc ^ data[:, column]) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
    return crc ^ np.uint32(0xFFFFFFFF)


def frame_crc(frame_id: int, payload: ByteArray, crc_bits: int) -> npt.NDArray[np.int64]:
    """CRC of payloads (n, bytes) whose first crc_bits / 8 bytes are the CRC itself; shape (n,)."""
    protected = np.empty((len(payload), 2 + payload.shape[1] - crc_bits // 8), np.uint8)
    protected[:, 0] = frame_id & 0xFF
    protected[:, 1] = frame_id >> 8
    protected[:, 2:] = payload[:, crc_bits // 8 :]
    crc = crc8(protected) if crc_bits == 8 else crc32p4(protected)
    return crc.astype(np.int64)
