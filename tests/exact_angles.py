"""The angles in whole numbers of any size: slow, and nothing of it is in the routine.

atan by halving the angle three times, tan(t / 2) = t / (1 + sqrt(1 + t^2)), and Taylor's series;
all values are integers of 2^-96. The result is within 1e-15 units of 2^-32 turn.
"""

from __future__ import annotations

import math
from fractions import Fraction

ONE = 1 << 96


def _atan(t: int) -> int:
    """atan of 0 <= t <= ONE, in radians."""
    for _ in range(3):
        t = t * ONE // (ONE + math.isqrt(ONE * ONE + t * t))
    total, power, k = 0, t, 1
    while power:
        total += power // k if k % 4 == 1 else -(power // k)
        power = power * t // ONE * t // ONE
        k += 2
    return 8 * total


HALF_TURN = 4 * _atan(ONE)


def _atan2(s: int, c: int) -> int:
    """atan2 of integers in the same unit, not both 0."""
    high, wide = abs(s), abs(c)
    first = _atan(min(high, wide) * ONE // max(high, wide))
    angle = HALF_TURN // 2 - first if high > wide else first
    angle = HALF_TURN - angle if c < 0 else angle
    return -angle if s < 0 else angle


def _units(angle: int) -> Fraction:
    return Fraction(angle << 31, HALF_TURN)


def exact(zenith: bool, x: int, y: int, z: int) -> tuple[Fraction, Fraction]:
    """Zenith and tool face, or pitch and roll, P0 (8), in units of 2^-32 turn."""
    scale = 1 << 64
    if zenith:
        across = math.isqrt((x * x + y * y) * scale * scale)
        return _units(_atan2(across, z * scale)), _units(_atan2(-y, -x))
    across = math.isqrt((y * y + z * z) * scale * scale)
    return _units(_atan2(-x * scale, across)), _units(_atan2(y, z))
