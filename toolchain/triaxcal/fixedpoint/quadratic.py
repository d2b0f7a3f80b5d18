"""Quadratic terms in integers: their format, and the sum that step Q adds to the linear one.

Source: docs/explanation/fixed-point.md, step Q.
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import high_word, round_half_up
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES, PRODUCT_NAMES
from triaxcal.model.types import FloatArray, IntArray

QUADRATIC_LIMIT = 2**31 - 1
"""A row's |q| sum to this at most: the terms come to 1/4 of the range of int32 at its ends."""

QUADRATIC_NAMES = tuple(f"Q{axis}{product}" for axis in AXES for product in PRODUCT_NAMES)
"""Names of the eighteen words, in image order."""


def quadratic_log2(output_q: int, spare: int) -> int:
    """Q of a word: q = Q 2^this, for Q in g/g^2."""
    return 64 - output_q - spare


def quantise_quadratic(per_g: FloatArray, log2: int, where: str) -> tuple[IntArray, FloatArray]:
    """Words (3, 6) and the real values that they stand for, of terms in g/g^2.

    Raises
    ------
    RefusedError
        When a row is too large to be a small nonlinearity.
    """
    real = per_g * 2.0**log2
    if not np.isfinite(real).all():
        raise RefusedError(where, "a quadratic term is not a finite number")
    words = np.array([[round_half_up(value) for value in row] for row in real.tolist()])
    sums = np.abs(words).sum(axis=1)
    if int(sums.max()) > QUADRATIC_LIMIT:
        row = int(sums.argmax())
        raise RefusedError(
            where,
            f"quadratic terms of axis {AXES[row]} sum to {np.abs(per_g[row]).sum():.4g} g/g^2",
            expected=f"at most {QUADRATIC_LIMIT / 2.0**log2:.4g} for the declared raw range",
            remedy="check the fit, or declare a narrower adc.code_min to adc.code_max",
        )
    return words.astype(np.int64), real


def linear_words(total: IntArray, offset: IntArray) -> IntArray:
    """h of sums (n, 3) and offsets (n, 3): the linear result before its rounding."""
    return high_word(total) + offset


def quadratic_sum(quadratic: IntArray, linear: IntArray) -> IntArray:
    """What is added to the sums, (n, 3), of h (n, 3)."""
    result = np.zeros_like(linear)
    for k, (first, second) in enumerate(PRODUCT_AXES):
        product = high_word(linear[:, first] * linear[:, second])
        for i in range(3):
            result[:, i] += quadratic[i, k] * product
    return result
