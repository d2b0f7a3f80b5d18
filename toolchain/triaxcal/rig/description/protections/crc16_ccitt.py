"""CRC-16 of AUTOSAR."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC16_CCITT
from triaxcal.rig.description.protection import plain

ENTRY = plain("crc-16", "CRC-16 of AUTOSAR", CRC16_CCITT, "polynomial 0x1021, start 0xFFFF", 23)
