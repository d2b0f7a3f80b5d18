"""Whole columns of signals out of payloads, by the layout that a bus description gives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.bus.frames import ByteArray

_WORD = 8
"""Bytes of a classic frame."""
_EXACT_BITS = 53
"""Of a float64."""
_FLOATS = {16: "<f2", 32: "<f4", 64: "<f8"}
_UNSIGNED = {16: "<u2", 32: "<u4", 64: "<u8"}

Word = npt.NDArray[np.uint64]


@dataclass(frozen=True)
class Signal:
    """Place and meaning of one signal, as the bus description states them.

    Attributes
    ----------
    start, length : int
        Bits, 1 to 64; `start` in the DBC's own numbering (of a big-endian signal its highest bit).
    scale, offset : int or float
        Value = raw * scale + offset; whole numbers where the description has whole numbers.
    is_float : bool
        The bits are an IEEE 754 number (SIG_VALTYPE_) of 16, 32 or 64 bits.
    unit : str
        Of the value, as the description has it.
    no_values : tuple of (int, str)
        Raw integers that are no value, and how the description names them, as "SNA".
    """

    name: str
    start: int
    length: int
    little_endian: bool
    signed: bool
    scale: float = 1
    offset: float = 0
    is_float: bool = False
    unit: str = ""
    no_values: tuple[tuple[int, str], ...] = ()

    @property
    def first_byte(self) -> int:
        """First byte of the payload that the signal touches."""
        return self.start // 8

    @cached_property
    def _drop(self) -> int:
        """Bits right of the signal in the number made of its bytes."""
        if self.little_endian:
            return self.start % 8
        return 8 * self.byte_count - (7 - self.start % 8) - self.length

    @cached_property
    def byte_count(self) -> int:
        """Bytes that the signal touches."""
        before = self.start % 8 if self.little_endian else 7 - self.start % 8
        return (before + self.length + 7) // 8

    @property
    def bits(self) -> int:
        """Bits of the payload that it takes, as bits of an integer: byte 0 lowest."""
        if self.little_endian:
            return ((1 << self.length) - 1) << self.start
        # Bits in the order in which a big-endian signal runs through the bytes.
        first = self.start // 8 * 8 + 7 - self.start % 8
        order = range(first, first + self.length)
        return sum(1 << (place // 8 * 8 + 7 - place % 8) for place in order)

    @property
    def is_plain(self) -> bool:
        """The value is the raw number."""
        return self.scale == 1 and self.offset == 0

    @property
    def ends(self) -> tuple[int, int]:
        """Smallest and largest raw integer."""
        low = -(1 << (self.length - 1)) if self.signed else 0
        return low, low + (1 << self.length) - 1

    def raw(self, data: ByteArray) -> IntArray:
        """Raw integers of payloads (n, bytes); shape (n,).

        Unsigned ones of 64 bits come as uint64, those of a float are its bits.
        """
        if data.shape[1] == _WORD and data.flags.c_contiguous:
            order, up = self._in_word
            words = data.view(order)[:, 0]
            return self._cut(words if order == "<u8" else words.astype(np.uint64), up)
        return self._cut(self._gathered(data), np.uint64(64 - self.length))

    @cached_property
    def _in_word(self) -> tuple[str, np.uint64]:
        """Order of eight bytes taken as one number, and the bits left of the signal in it."""
        if self.little_endian:
            return "<u8", np.uint64(64 - self.start - self.length)
        return ">u8", np.uint64(self.start // 8 * 8 + 7 - self.start % 8)

    @cached_property
    def _down(self) -> np.uint64:
        return np.uint64(64 - self.length)

    def _cut(self, words: Word, up: np.uint64) -> IntArray:
        """Up to the top and back: what is left of the signal falls off, or its sign extends."""
        top = words << up
        if self.signed and not self.is_float:
            return top.view(np.int64) >> (64 - self.length)
        raw = top >> self._down
        return raw if self.length == 64 else raw.view(np.int64)  # type: ignore[return-value]

    def _gathered(self, data: ByteArray) -> Word:
        """Number made of the signal's bytes, its bits at the right; nine bytes of 64 bits too."""
        total = np.zeros(len(data), np.uint64)
        for i in range(self.byte_count):
            place = i if self.little_endian else self.byte_count - 1 - i
            up = 8 * place - self._drop
            byte = data[:, self.first_byte + i].astype(np.uint64)
            total |= byte << np.uint64(up) if up >= 0 else byte >> np.uint64(-up)
        return total

    def number(self, data: ByteArray) -> IntArray | FloatArray:
        """Numbers as they are sent, before scale and offset; of a float, float64; shape (n,)."""
        raw = self.raw(data)
        if not self.is_float:
            return raw
        bits = raw.astype(_UNSIGNED[self.length])
        with np.errstate(invalid="ignore"):  # a signalling NaN
            return bits.view(_FLOATS[self.length]).astype(np.float64)

    def value(self, data: ByteArray) -> FloatArray:
        """Physical values of payloads (n, bytes), float64, shape (n,); nearest to the exact ones.

        The operations, and so the last bits, are those of cantools.
        """
        number = self.number(data)
        if self.is_plain:
            return number.astype(np.float64)
        scale, offset = self.scale, self.offset
        whole = isinstance(scale, int) and not self.is_float
        if whole and self.length + int(scale).bit_length() > _EXACT_BITS:
            # Python's integers are exact where products of floats are not.
            return np.array([float(n * scale + offset) for n in number.tolist()], np.float64)
        with np.errstate(over="ignore", invalid="ignore"):  # what is no number is found later
            return number.astype(np.float64) * scale + offset

    def put(self, data: ByteArray, raw: IntArray) -> None:
        """Write raw integers (n,) into payloads (n, bytes) whose bits there are zero."""
        bits = (raw & ((1 << self.length) - 1)) << self._drop
        for i in range(self.byte_count):
            place = i if self.little_endian else self.byte_count - 1 - i
            data[:, self.first_byte + i] |= ((bits >> (8 * place)) & 0xFF).astype(np.uint8)
