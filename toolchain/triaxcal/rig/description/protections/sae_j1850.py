"""SAE J1850 CRC-8."""

from __future__ import annotations

from triaxcal.rig.description.crc import CRC8_J1850
from triaxcal.rig.description.protection import plain

ENTRY = plain(
    "sae-j1850", "SAE J1850 CRC-8", CRC8_J1850, "polynomial 0x1D, start 0xFF, inverted", 20
)
