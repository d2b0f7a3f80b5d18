"""CRC-8H2F."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC8_2F
from triaxcal.rig.description.protection import plain

ENTRY = plain("crc-8h2f", "CRC-8H2F", CRC8_2F, "polynomial 0x2F, start 0xFF, inverted", 21)
