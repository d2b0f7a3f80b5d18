"""Rational intervals that hold pi, arc tangents, square roots: for proofs without floats."""

from __future__ import annotations

import math
from fractions import Fraction

_DENOMINATOR = 1 << 160
"""Bounds are rounded to this, so that fractions stay short."""
_TERMS_END = Fraction(1, 1 << 150)

Interval = tuple[Fraction, Fraction]


def upwards(value: Fraction) -> Fraction:
    """A short fraction, at least the value."""
    return Fraction(math.ceil(value * _DENOMINATOR), _DENOMINATOR)


def downwards(value: Fraction) -> Fraction:
    """A short fraction, at most the value."""
    return Fraction(math.floor(value * _DENOMINATOR), _DENOMINATOR)


def arc_tangent(x: Fraction) -> Interval:
    """atan of 0 <= x <= 1/2, in radians, by its alternating series.

    Neighbouring partial sums are on both sides of the limit.
    """
    if not 0 <= x <= Fraction(1, 2):
        raise ValueError(f"arc_tangent of {x}")
    total, power, k = Fraction(0), x, 0
    sums = [total]
    while power / (2 * k + 1) > _TERMS_END or k < 2:
        total += (-1) ** k * power / (2 * k + 1)
        power *= x * x
        k += 1
        sums.append(total)
    return downwards(min(sums[-2:])), upwards(max(sums[-2:]))


def pi() -> Interval:
    """pi = 16 atan(1/5) - 4 atan(1/239), Machin."""
    fifth, small = arc_tangent(Fraction(1, 5)), arc_tangent(Fraction(1, 239))
    return 16 * fifth[0] - 4 * small[1], 16 * fifth[1] - 4 * small[0]


def square_root(value: Fraction) -> Interval:
    """Square root of a value that is not negative."""
    scaled = value * _DENOMINATOR * _DENOMINATOR
    return (
        Fraction(math.isqrt(math.floor(scaled)), _DENOMINATOR),
        Fraction(math.isqrt(math.ceil(scaled)) + 1, _DENOMINATOR),
    )
