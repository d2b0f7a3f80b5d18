"""K(T) inverted in integers: adjugate, one division, nine products.

Source: docs/explanation/fixed-point.md, step I.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fixedpoint.arithmetic import saturate_int32
from triaxcal.model.types import IntArray


@dataclass(frozen=True)
class InverseShifts:
    """Shifts that keep every word of the inversion full.

    Attributes
    ----------
    adjugate_shift : int
        Of the 64-bit adjugate of K, to 32 bits.
    determinant_shift : int
        Of the 64-bit determinant (already a quarter of itself), to 32 bits.
    reciprocal_log2 : int
        The reciprocal is 2^reciprocal_log2 / determinant.
    gain_shift : int
        Of adjugate times reciprocal, to the gain's format.
    """

    adjugate_shift: int
    determinant_shift: int
    reciprocal_log2: int
    gain_shift: int

    @property
    def scale_log2(self) -> int:
        """log2 of the gain's integer over the inverse of K's integers."""
        return self.reciprocal_log2 + 2 + self.determinant_shift - self.gain_shift

    @property
    def determinant_min(self) -> int:
        """Least magnitude whose reciprocal fits int32; smaller ones are taken as this."""
        return (1 << (self.reciprocal_log2 - 31)) + 1


def adjugate(K: IntArray) -> IntArray:
    """Adjugate, shape (n, 3, 3), exact in int64 for |K_ij| < 2^31."""
    result = np.empty_like(K)
    for i in range(3):
        for j in range(3):
            a, b, c, d = (j + 1) % 3, (i + 1) % 3, (j + 2) % 3, (i + 2) % 3
            result[:, i, j] = K[:, a, b] * K[:, c, d] - K[:, a, d] * K[:, c, b]
    return result


def quarter_determinant(K: IntArray, adjugate_word: IntArray) -> IntArray:
    """Determinant / 4 by the first row, shape (n,); each product is shifted before it is added."""
    total: IntArray = ((K[:, 0, :] * adjugate_word[:, :, 0]) >> 2).sum(axis=1)
    return total


def reciprocal(determinant_word: IntArray, shifts: InverseShifts) -> IntArray:
    """2^reciprocal_log2 / determinant towards zero, with the determinant kept away from zero."""
    magnitude = np.maximum(np.abs(determinant_word), shifts.determinant_min)
    quotient = (np.int64(1) << np.int64(shifts.reciprocal_log2)) // magnitude
    return np.where(determinant_word < 0, -quotient, quotient)


def invert(
    functions: IntArray, shifts: InverseShifts, rounding_in_offset: int
) -> tuple[IntArray, IntArray]:
    """Gain (n, 3, 3) and offset (n, 3) of K and U0, shape (n, 3, 4)."""
    K, U0 = functions[:, :, :3], functions[:, :, 3]
    adjugate_word = saturate_int32(adjugate(K) >> shifts.adjugate_shift)
    determinant = quarter_determinant(K, adjugate_word)
    determinant_word = saturate_int32(determinant >> shifts.determinant_shift)
    inverse = reciprocal(determinant_word, shifts)[:, None, None]
    half = 1 << (shifts.gain_shift - 1)
    gain = saturate_int32((adjugate_word * inverse + half) >> shifts.gain_shift)
    return gain, offset_of(gain, U0, rounding_in_offset)


def offset_of(gain: IntArray, U0: IntArray, rounding_in_offset: int) -> IntArray:
    """-(gain U0) / 2^32 half up, shape (n, 3), plus the rounding that apply expects there."""
    product = ((gain * U0[:, None, :]) >> 2).sum(axis=2)
    return saturate_int32(rounding_in_offset - ((product + (1 << 29)) >> 30))
