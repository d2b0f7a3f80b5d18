"""Cyclic redundancy checks of many payloads at once, by their parameters.

The parameters are those of Williams, "A painless guide to CRC error detection algorithms" (1993),
under which the catalogues list every CRC in use.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray


@dataclass(frozen=True)
class Crc:
    """A CRC of 8 to 32 bits.

    Attributes
    ----------
    polynomial, start, final : int
        Without the highest bit; register at the start; what the register is XORed with at the end.
    reflected : bool
        Input and output from the lowest bit.
    """

    bits: int
    polynomial: int
    start: int
    final: int
    reflected: bool = False

    @cached_property
    def _table(self) -> np.ndarray:
        kind = np.dtype(f"u{self.bits // 8}")
        top, every = 1 << (self.bits - 1), (1 << self.bits) - 1
        mirrored = int(f"{self.polynomial:0{self.bits}b}"[::-1], 2)
        table = []
        for byte in range(256):
            register = byte if self.reflected else byte << (self.bits - 8)
            for _ in range(8):
                if self.reflected:
                    register = (register >> 1) ^ (mirrored if register & 1 else 0)
                else:
                    register = (register << 1) ^ (self.polynomial if register & top else 0)
            table.append(register & every)
        return np.array(table, kind)

    def of(self, data: ByteArray) -> IntArray:
        """CRC of each row of (n, bytes); shape (n,)."""
        table = self._table
        kind = table.dtype.type
        crc = np.full(len(data), self.start, kind)
        for column in range(data.shape[1]):
            byte = data[:, column]
            if self.bits == 8:
                crc = table[crc ^ byte]
            elif self.reflected:
                crc = table[(crc ^ byte) & kind(0xFF)] ^ (crc >> kind(8))
            else:
                crc = table[(crc >> kind(self.bits - 8)) ^ byte] ^ (crc << kind(8))
        return np.asarray(crc ^ kind(self.final), np.int64)


CRC8_J1850 = Crc(8, 0x1D, 0xFF, 0xFF)
CRC8_2F = Crc(8, 0x2F, 0xFF, 0xFF)
CRC8 = Crc(8, 0x07, 0, 0)
CRC16_CCITT = Crc(16, 0x1021, 0xFFFF, 0)
CRC32_ETHERNET = Crc(32, 0x04C11DB7, 0xFFFFFFFF, 0xFFFFFFFF, reflected=True)
CRC32_P4 = Crc(32, 0xF4ACFB13, 0xFFFFFFFF, 0xFFFFFFFF, reflected=True)
"""SAE J1850; AUTOSAR's CRC-8H2F; CRC-8 of SMBus; AUTOSAR's CRC-16, CRC-32 and CRC-32P4.

AUTOSAR, Specification of CRC Routines.
"""
