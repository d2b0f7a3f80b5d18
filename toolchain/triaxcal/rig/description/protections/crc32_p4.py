"""CRC-32P4."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC32_P4
from triaxcal.rig.description.protection import plain

ENTRY = plain(
    "crc-32p4",
    "CRC-32P4",
    CRC32_P4,
    "polynomial 0xF4ACFB13, reflected, start 0xFFFFFFFF, inverted",
    25,
)
