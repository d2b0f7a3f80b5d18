"""Whole columns of signals out of and into payloads, by the layout that a DBC gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.frames import ByteArray

_WORD = 8
"""Bytes of a classic frame."""


@dataclass(frozen=True)
class Signal:
    """Place and meaning of one signal, as a DBC line SG_ states them.

    Attributes
    ----------
    start, length : int
        Bits; `start` in the DBC's own numbering (of a big-endian signal its highest bit).
    scale, offset : float
        Value = raw * scale + offset.
    """

    name: str
    start: int
    length: int
    little_endian: bool
    signed: bool
    scale: float = 1.0
    offset: float = 0.0

    @property
    def first_byte(self) -> int:
        """First byte of the payload that the signal touches."""
        return self.start // 8

    @property
    def _drop(self) -> int:
        """Bits right of the signal in the number made of its bytes."""
        if self.little_endian:
            return self.start % 8
        return 8 * self.byte_count - (7 - self.start % 8) - self.length

    @property
    def byte_count(self) -> int:
        """Bytes that the signal touches."""
        before = self.start % 8 if self.little_endian else 7 - self.start % 8
        return (before + self.length + 7) // 8

    def raw(self, data: ByteArray) -> IntArray:
        """Raw integers of payloads (n, bytes); shape (n,).

        Raises
        ------
        ValueError
            When the signal spans more than 63 bits of payload bytes.
        """
        if self.byte_count > 7 and not (self.byte_count == 8 and self._drop == 0 and self.signed):
            raise ValueError(f"{self.name}: {self.length} bits are more than this decoder takes")
        if data.shape[1] == _WORD and data.flags.c_contiguous:
            return self._of_words(data)
        total = np.zeros(len(data), np.int64)
        for i in range(self.byte_count):
            place = i if self.little_endian else self.byte_count - 1 - i
            total |= data[:, self.first_byte + i].astype(np.int64) << (8 * place)
        if self.signed:
            # Up to the sign bit and back: the arithmetic shift extends the sign.
            up = 64 - self.length - self._drop
            return (total << up) >> (64 - self.length)
        return (total >> self._drop) & ((1 << self.length) - 1)

    def _of_words(self, data: ByteArray) -> IntArray:
        """The same out of payloads of eight bytes, each taken as one number."""
        if self.little_endian:
            words, drop = data.view("<i8")[:, 0], self.start
        else:
            first_bit = self.start // 8 * 8 + 7 - self.start % 8
            words, drop = data.view(">i8")[:, 0], 64 - first_bit - self.length
        if self.signed:
            return (words.astype(np.int64) << (64 - self.length - drop)) >> (64 - self.length)
        return (words.astype(np.int64) >> drop) & ((1 << self.length) - 1)

    def value(self, data: ByteArray) -> FloatArray:
        """Physical values of payloads (n, bytes); shape (n,)."""
        return self.raw(data).astype(np.float64) * self.scale + self.offset

    def put(self, data: ByteArray, raw: IntArray) -> None:
        """Write raw integers (n,) into payloads (n, bytes) whose bits there are zero."""
        bits = (raw & ((1 << self.length) - 1)) << self._drop
        for i in range(self.byte_count):
            place = i if self.little_endian else self.byte_count - 1 - i
            data[:, self.first_byte + i] |= ((bits >> (8 * place)) & 0xFF).astype(np.uint8)
