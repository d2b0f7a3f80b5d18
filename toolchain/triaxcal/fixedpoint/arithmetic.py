"""Rules of the integer arithmetic, one function each, the same in Python and in C.

Right shifts floor; rounding is half up and is preloaded as a constant; results saturate to int32.
All values are int64 arrays whose magnitudes the plan has bounded, so nothing here can wrap.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.model.types import IntArray

INT32_MIN = -(2**31)
INT32_MAX = 2**31 - 1


def round_half_up(value: float) -> int:
    """Nearest integer, halves upwards."""
    return math.floor(value + 0.5)


def high_word(value: IntArray) -> IntArray:
    """floor(value / 2^32)."""
    return value >> 32


def saturate_int32(value: IntArray) -> IntArray:
    """Nearest value of int32."""
    clipped: IntArray = np.clip(value, INT32_MIN, INT32_MAX)
    return clipped
