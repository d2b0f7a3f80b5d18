"""CRC-8."""

from __future__ import annotations

from triaxcal.rig.crc import CRC8
from triaxcal.rig.protection import plain

ENTRY = plain("crc-8", "CRC-8", CRC8, "polynomial 0x07, start 0", 22)
