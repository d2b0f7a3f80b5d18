"""Specific forces and rates of temperature for the vectors that a routine is tried on.

A gyro's answer depends on the accelerometer's. Where the gyro is tried alone, the force belongs to
the vector: it is a hash of its codes, so that every implementation is given the same. So is dT/dt,
of the temperature code.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from triaxcal.fixedpoint.rate import RatePlan
from triaxcal.model.types import IntArray

_ENDS = np.array([-(2**31), 2**31 - 1], dtype=np.int64)


def forces_of(temp: npt.NDArray[np.integer], raw: npt.NDArray[np.integer]) -> IntArray:
    """Forces (n, 3) of temperature codes (n,) and raw codes (n, 3).

    Of four vectors one has no force, one has ends of int32 and two have anything.
    """
    mixed = np.zeros(len(temp), np.uint32)
    for column in (temp, raw[:, 0], raw[:, 1], raw[:, 2]):
        mixed = _scramble(mixed ^ column.astype(np.int64).astype(np.uint32))
    kind = (mixed & np.uint32(3))[:, None]
    words = np.stack([_scramble(mixed + np.uint32(j + 1)) for j in range(3)], axis=1)
    anything = words.view(np.int32).astype(np.int64)
    return np.where(kind == 0, 0, np.where(kind == 1, _ENDS[words & np.uint32(1)], anything))


def rate_edges(rate: RatePlan) -> list[int]:
    """Around both ends of the range of rates and zero, and the ends of int32."""
    low, high = rate.min_code, rate.max_code
    ends = [-(2**31), low - 1, low, low + 1, -1, 1, high - 1, high, high + 1, 2**31 - 1]
    return [min(max(end, -(2**31)), 2**31 - 1) for end in ends]


def rates_of(rate: RatePlan, temp: npt.NDArray[np.integer]) -> IntArray:
    """Rates (n,) for a term in dT/dt, of temperature codes (n,).

    Of four vectors one has no rate, one an end of the range, of int32, or next to one, and two
    have a rate in range.
    """
    word = _scramble(temp.astype(np.int64).astype(np.uint32)).astype(np.int64)
    low, high = rate.min_code, rate.max_code
    ends = np.array(rate_edges(rate), dtype=np.int64)
    edge = ends[(word >> 2) % len(ends)]
    between = low + (word >> 2) % (high - low + 1)
    kind = word & 3
    return np.where(kind == 0, 0, np.where(kind == 1, edge, between))


def _scramble(x: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """The finaliser of MurmurHash3 on a Weyl step."""
    x = x * np.uint32(0x9E3779B9) + np.uint32(0x7F4A7C15)
    x = (x ^ (x >> np.uint32(16))) * np.uint32(0x85EBCA6B)
    x = (x ^ (x >> np.uint32(13))) * np.uint32(0xC2B2AE35)
    result: npt.NDArray[np.uint32] = x ^ (x >> np.uint32(16))
    return result
