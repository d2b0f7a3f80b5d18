"""The term in dT/dt in integers, step D: an offset for the rate that the caller gives.

Source: docs/explanation/fixed-point.md, step D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import INT32_MAX, high_word, round_half_up
from triaxcal.model.terms import RateTerm
from triaxcal.model.types import FloatArray, IntArray

RATE_Q = 16
"""A rate is given in 2^-16 temperature codes per second."""


@dataclass(frozen=True)
class RatePlan:
    """Integers of the term in dT/dt.

    Attributes
    ----------
    min_code, max_code : int
        Rates in which it was fitted, in 2^-RATE_Q temperature codes per second, zero between them.
    gain : int
        Power of two that makes a rate fill int32.
    words : array, shape (3,)
        d = floor((word * rate * gain + 2^31) / 2^32) is added to the offset.
    real : array, shape (3,)
        What they stand for, in units of their last place.
    """

    min_code: int
    max_code: int
    gain: int
    words: IntArray
    real: FloatArray

    @property
    def reach(self) -> int:
        """Largest magnitude of a rate times the gain."""
        return max(-self.min_code, self.max_code) * self.gain

    def offset(self, rate_code: IntArray) -> tuple[IntArray, IntArray]:
        """Offsets (n, 3) of rates (n,), any int32, and where a rate was clamped (n,)."""
        clamped = np.clip(rate_code, self.min_code, self.max_code)
        product = self.words * (clamped * self.gain)[:, None]
        return high_word(product + (1 << 31)), np.asarray(clamped != rate_code)


def largest_offset_g(term: RateTerm) -> FloatArray:
    """Largest |offset| in g of each axis over the term's range, shape (3,)."""
    fastest: FloatArray = np.abs(term.offset_g_s_per_k) * np.abs(term.range_k_per_s).max()
    return fastest


def plan_rate(term: RateTerm, fraction: int, degc_per_code: float, where: str) -> RatePlan:
    """Integers of a term; the offset's last place is 2^-fraction g.

    Raises
    ------
    RefusedError
        When the range of rates has no code, or does not fit int32.
    """
    low, high = (k / degc_per_code * 2.0**RATE_Q for k in term.range_k_per_s)
    first, last = int(np.ceil(low - 1e-6)), int(np.floor(high + 1e-6))
    fastest = max(-first, last)
    if not 0 < fastest <= INT32_MAX:
        raise RefusedError(
            where,
            f"rates of {term.range_k_per_s[0]:g} to {term.range_k_per_s[1]:g} K/s are codes of "
            f"{first} to {last}",
            expected=f"codes other than 0, within {INT32_MAX}, each of "
            f"{degc_per_code / 2**RATE_Q:.3g} K/s",
            remedy="check temperature_sensor.degc_per_code and the unit of the rates",
        )
    gain = 1 << (31 - fastest.bit_length())
    real = term.offset_g_s_per_k * (2.0 ** (fraction + 32 - RATE_Q) * degc_per_code / gain)
    if not np.isfinite(real).all() or np.abs(real).max() > INT32_MAX - 1:
        raise RefusedError(
            where,
            f"an offset of {largest_offset_g(term).max():.4g} g by dT/dt at the ends of its range",
            expected="less than the declared raw range stands for",
            remedy="check the unit of the rates, K/s, and the fit",
        )
    words = np.array([round_half_up(v) for v in real.tolist()], dtype=np.int64)
    return RatePlan(first, last, gain, words, real)
