"""The thermal functions in integers: a segment's coefficients and Horner's rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fixedpoint.arithmetic import high_word
from triaxcal.model.types import IntArray


@dataclass(frozen=True)
class Segment:
    """One segment of the piecewise polynomial.

    Attributes
    ----------
    first_code : int
        Lowest temperature code of the segment.
    origin_code : int
        Code where x = 0.
    gain : int
        x = (code - origin_code) * gain, Q31; a power of two, so x is exact.
    coefficients : array, shape (12, order + 1)
        c_k of each function in image order, constant first; |p_k| stays within int32.
    """

    first_code: int
    origin_code: int
    gain: int
    coefficients: IntArray


def segment_of(segments: Sequence[Segment], temp_code: IntArray) -> IntArray:
    """Index of the segment of each code (already clamped to the range), same shape."""
    inner = np.array([s.first_code for s in segments[1:]], dtype=np.int64)
    return np.searchsorted(inner, temp_code, side="right").astype(np.int64)


def horner(segments: Sequence[Segment], temp_code: IntArray, index: IntArray) -> IntArray:
    """Twelve functions, shape (n, 12), of codes of shape (n,), bit-exact to the routine."""
    origin = np.array([s.origin_code for s in segments], dtype=np.int64)[index]
    gain = np.array([s.gain for s in segments], dtype=np.int64)[index]
    x_q31 = ((temp_code - origin) * gain)[:, None]
    coefficients = np.stack([s.coefficients for s in segments])
    order = coefficients.shape[2] - 1
    value: IntArray = coefficients[index, :, order]
    for k in range(order - 1, -1, -1):
        value = coefficients[index, :, k] + high_word(x_q31 * value)
    return value
