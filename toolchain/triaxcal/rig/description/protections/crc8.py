"""CRC-8."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC8
from triaxcal.rig.description.protection import plain

ENTRY = plain("crc-8", "CRC-8", CRC8, "polynomial 0x07, start 0", 22)
