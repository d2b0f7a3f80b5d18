"""CRC-32 of Ethernet."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC32_ETHERNET
from triaxcal.rig.description.protection import plain

ENTRY = plain(
    "crc-32",
    "CRC-32 of Ethernet",
    CRC32_ETHERNET,
    "polynomial 0x04C11DB7, reflected, start 0xFFFFFFFF, inverted",
    24,
)
