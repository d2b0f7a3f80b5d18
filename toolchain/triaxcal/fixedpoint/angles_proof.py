"""The proven error of triax_angles, from the constants that the C has: rationals only.

docs/explanation/angles.md derives each term. Angles inside are radians, rounded upwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from triaxcal.fixedpoint.angles import (
    DIGITS,
    FRACTION,
    PER_LENGTH,
    QUOTIENT_UNITS,
    ROTATION_UNITS,
    ROTATIONS,
    START_UNITS,
    TURN,
)
from triaxcal.fixedpoint.enclosure import Interval, arc_tangent, downwards, pi, square_root, upwards

_LEAST = Fraction(1 << 29)
"""Length of a normalised vector, at least: its larger part is 2^29 to 2^30."""
_MOST = 1 << 30
_SQRT2, _SQRT3 = square_root(Fraction(2))[1], square_root(Fraction(3))[1]
_INT32, _UINT32 = 1 << 31, 1 << 32
_PI = pi()
_PER_RADIAN = Fraction(TURN) / (2 * _PI[0])


@dataclass(frozen=True)
class Term:
    """One cause of error, and its bound in units of 2^-32 turn."""

    name: str
    units: Fraction


@dataclass(frozen=True)
class AnglesBound:
    """Proven largest error of each angle against the exact one of the same integers.

    Attributes
    ----------
    first, second : tuple of Term
        Of zenith or pitch; of tool face or roll.
    """

    first: tuple[Term, ...]
    second: tuple[Term, ...]

    @property
    def units(self) -> tuple[Fraction, Fraction]:
        """Sums of the terms."""
        return _sum(self.first), _sum(self.second)


def _sum(terms: tuple[Term, ...]) -> Fraction:
    return sum((t.units for t in terms), Fraction(0))


def prove_angles() -> AnglesBound:
    """Bound both angles, for every triad of int32 for which they exist.

    Raises
    ------
    AssertionError
        When a word could leave its type: then the constants are wrong.
    """
    second = _Turned(_LEAST - _SQRT2, _SQRT2 * _MOST)
    factor, added = second.length_error()
    beside = square_root(added**2 + 1)[1]
    first = _Turned(_LEAST * (1 - factor) - beside, _SQRT3 * (1 + factor) * _MOST + beside)
    return AnglesBound(
        first=(
            *first.terms(),
            Term("last cosine, rounded 2^32 / K", factor * (1 + factor) / 2 * _PER_RADIAN),
            Term("floors of the length", _angle(beside, _LEAST * (1 - factor)) * _PER_RADIAN),
        ),
        second=(
            *second.terms(),
            Term("components of 2^30 and more", _angle(_SQRT2, _LEAST) * _PER_RADIAN),
        ),
    )


class _Turned:
    """What `polar` does to a vector of length `shortest` to `longest`, at most 90 deg from y = 0.

    Attributes
    ----------
    left : Fraction
        Angle to y = 0 after all rotations, at most.
    slips : Fraction
        Sum of the angles by which the floors turn the vector, at most.
    lost : Fraction
        What the floors change of its final length, at most.
    low, high : Fraction
        Its final length.
    """

    def __init__(self, shortest: Fraction, longest: Fraction) -> None:
        assert longest < _INT32
        self.low, self.high, self.left = shortest, longest, _PI[1] / 2
        self.slips, self.lost = Fraction(0), Fraction(0)
        for i in range(ROTATIONS):
            self._rotate(i)
        # The division begins with |rest| <= divisor, which each digit keeps. tan u <= u + u^3.
        slope = self.left + self.left**3
        assert slope * (1 << (ROTATIONS - 3)) <= (1 - 2 / self.low) / 2
        assert self.high / 2 < _INT32
        assert (QUOTIENT_UNITS << DIGITS) < _UINT32

    def _rotate(self, i: int) -> None:
        growth = square_root(1 + Fraction(1, 1 << (2 * i)))
        step = rotation(i)
        left = max(step[1], self.left - step[0])
        # Errors of at most 1 in x and in y. Of a vector at the angle t to the axis, cos t + sin t
        # of them is across it, and as much along it.
        error = min(_SQRT2, 1 + left)
        self.low = downwards(self.low * growth[0] - _SQRT2)
        self.high = upwards(self.high * growth[1] + _SQRT2)
        slip = _angle(error, self.low)
        self.left, self.slips = left + slip, self.slips + slip
        self.lost = upwards(self.lost * growth[1] + error + error**2 / self.low)
        assert self.high < _UINT32
        assert i == 0 or self.high * self.left < _INT32

    def terms(self) -> tuple[Term, ...]:
        """Terms of the angle."""
        # y / x = rest / divisor * 2^-(ROTATIONS - 2); the divisor is x / 2 or (x - 1) / 2.
        quotient = (Fraction(1, 1 << DIGITS) + 4 / self.low) / (1 << (ROTATIONS - 2))
        return (
            Term("floors of the rotations", self.slips * _PER_RADIAN),
            Term("rounded atan(2^-i)", _table_error()),
            Term("digits of y / x", quotient * _PER_RADIAN),
            Term("atan t is not t", self.left**3 / 3 * _PER_RADIAN),
            Term("y / x in units", _scale_error()),
        )

    def length_error(self) -> tuple[Fraction, Fraction]:
        """Of length PER_LENGTH / 2^32 against |(x, y)|: a factor's distance from 1, and a sum.

        The vector's own floors, where it had to be shifted right, are in the sum.
        """
        square = Fraction(1)
        for i in range(ROTATIONS):
            square *= 1 + Fraction(1, 1 << (2 * i))
        growth, gain = square_root(square), Fraction(PER_LENGTH, TURN)
        cosine = 1 - self.left**2 / 2
        factor = max(abs(1 - gain * growth[0] * cosine), abs(gain * growth[1] - 1))
        # Shifted to the other component's scale: at least halved, and floored by less than 1.
        added = self.lost * gain + _SQRT2 * gain * growth[1] + 1
        return factor, max(added, added / 2 + 1)


def rotation(i: int) -> Interval:
    """atan(2^-i) in radians."""
    return (_PI[0] / 4, _PI[1] / 4) if i == 0 else arc_tangent(Fraction(1, 1 << i))


def _angle(across: Fraction, length: Fraction) -> Fraction:
    """At most asin(across / length), of a small one: asin u <= u + u^3."""
    u = across / length
    assert u < Fraction(1, 1000)
    return upwards(u + u**3)


def _table_error() -> Fraction:
    """Of the sum of the rotations: each stands for half a unit more than its word."""
    total = abs(ROTATION_UNITS[0] + Fraction(1, 2) - Fraction(TURN, 8))
    for i in range(1, ROTATIONS):
        low, high = rotation(i)
        exact = TURN * low / (2 * _PI[1]), TURN * high / (2 * _PI[0])
        total += max(abs(ROTATION_UNITS[i] + Fraction(1, 2) - end) for end in exact)
    return total


def _scale_error() -> Fraction:
    """Of START_UNITS + floor(quotient QUOTIENT_UNITS / 2^FRACTION), the quotient 1 to 2^DIGITS.

    It stands for (2 quotient - 2^DIGITS - 1) 2^-(ROTATIONS - 2 + DIGITS) rad. The start also has
    the half units of the rotations and of this floor.
    """
    scale = Fraction(QUOTIENT_UNITS, 1 << FRACTION)
    middle = START_UNITS - Fraction(ROTATIONS + 1, 2) + scale * ((1 << DIGITS) + 1) / 2
    exact = [Fraction(TURN) / (2 * p) / (1 << (ROTATIONS - 3 + DIGITS)) for p in _PI]
    off = max(abs(scale - right) for right in exact)
    return abs(middle) + off * ((1 << DIGITS) - 1) / 2 + Fraction(1, 2)
