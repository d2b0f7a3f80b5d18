"""Two angles from a compensated triad, in integers: what triax_angles must equal bit for bit.

docs/explanation/angles.md specifies the steps. Angles are binary: one unit is 2^-32 of a turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from triaxcal.fixedpoint.enclosure import arc_tangent, pi, square_root
from triaxcal.model.types import IntArray
from triaxcal.unit.angles import ZENITH_TOOL_FACE, AnglesChoice

ROTATIONS = 13
"""Of a vector towards its first axis, by atan(2^-i), i = 0 to 12."""
DIGITS = 15
"""Of the quotient that is left, y / x."""
FRACTION = 12
"""Bits behind the point of `QUOTIENT_UNITS`."""

_BLOCK = 4096
"""Rows of the Python model: its working arrays stay in the cache."""

TURN = 1 << 32
QUARTER = 1 << 30
STATUS_SECOND_ANGLE = 64
STATUS_NOT_AT_REST = 128

ARCSEC_PER_UNIT = 1296000 / TURN


def _rotation_units() -> tuple[int, ...]:
    """Floors of atan(2^-i) in units: half a unit less than what a step stands for."""
    low, high = pi()
    words = [TURN // 8]
    for i in range(1, ROTATIONS):
        angle = arc_tangent(Fraction(1, 1 << i))
        floors = {math.floor(TURN * angle[0] / (2 * high)), math.floor(TURN * angle[1] / (2 * low))}
        (word,) = floors
        words.append(word)
    return tuple(words)


def _per_length() -> int:
    """2^32 / K, K the growth by all rotations, at the middle of what the last cosine takes off.

    After the rotations |y| <= 2^-(ROTATIONS - 1) x, so x is 0 to 2^-(2 ROTATIONS - 1) short.
    """
    growth = Fraction(1)
    for i in range(ROTATIONS):
        growth *= 1 + Fraction(1, 1 << (2 * i))
    middle = 1 - Fraction(1, 1 << (2 * ROTATIONS))
    return round(TURN / (square_root(growth)[0] * middle))


ROTATION_UNITS = _rotation_units()
QUOTIENT_UNITS = round(Fraction(TURN << FRACTION, 1 << (ROTATIONS - 3 + DIGITS)) / (2 * pi()[0]))
"""Units of two digits' worth, 2^-(ROTATIONS - 3 + DIGITS) rad, with `FRACTION` bits more."""
START_UNITS = round(
    Fraction(ROTATIONS, 2)
    + Fraction(1, 2)
    - Fraction(((1 << DIGITS) + 1) * QUOTIENT_UNITS, 1 << (FRACTION + 1))
)
"""What the floors take off in the middle, and the middle of all quotients."""
PER_LENGTH = _per_length()


@dataclass(frozen=True)
class AnglesPlan:
    """What the generated routine needs to know.

    Attributes
    ----------
    choice : AnglesChoice
    output_q : int
        The LSB of the acceleration is 2^-output_q g.
    halves : bool
        Whether the C forms its products of halves of words, for cores without a multiplication of
        32 bits by 32 to 64.
    rest_low, rest_high : int
        |a|^2 / 2, floored, is within these at rest, LSB^2.
    across_low : int
        (c^2 + s^2) / 2, floored, is at least this where the second angle is good.
    """

    choice: AnglesChoice
    output_q: int
    halves: bool = False

    @property
    def rest_low(self) -> int:  # noqa: D102  stated above
        return self._half_square(1.0 - self.choice.rest_within_g)

    @property
    def rest_high(self) -> int:  # noqa: D102
        return self._half_square(1.0 + self.choice.rest_within_g)

    @property
    def across_low(self) -> int:  # noqa: D102
        return self._half_square(math.sin(math.radians(self.choice.second_from_deg)))

    def _half_square(self, force_g: float) -> int:
        # 12 decimals: what the last bit of a library's sine is does not matter.
        return round(Fraction(f"{force_g:.12f}") ** 2 * (1 << (2 * self.output_q)) / 2)

    @property
    def zenith(self) -> bool:
        """Whether the angles are zenith and tool face, and not pitch and roll."""
        return self.choice.pair == ZENITH_TOOL_FACE


def angles(plan: AnglesPlan, accel: IntArray) -> tuple[IntArray, IntArray]:
    """Angles (n, 2) and status (n,) of triads (n, 3), any int32, as int64.

    Zenith is 0 to 2^31, tool face 0 to 2^32 - 1; pitch is -2^30 to 2^30, roll -2^31 to 2^31 - 1.
    """
    result = np.empty((len(accel), 2), np.int64)
    status = np.empty(len(accel), np.int64)
    for start in range(0, len(accel), _BLOCK):
        block = slice(start, start + _BLOCK)
        result[block], status[block] = _angles(plan, accel[block])
    return result, status


def _angles(plan: AnglesPlan, accel: IntArray) -> tuple[IntArray, IntArray]:
    x, y, z = (accel[:, i].astype(np.int64) for i in range(3))
    c, s, a = (x, y, z) if plan.zenith else (z, y, x)
    wide, high, along = np.abs(c), np.abs(s), np.abs(a)
    across_any = np.bitwise_or(wide, high)
    any_part = np.bitwise_or(across_any, along)
    # The vector (c, s) turned by half a turn where c is negative, its larger part 2^29 to 2^30.
    left = normalising_shift(across_any)
    sign = np.where((c < 0) == (s < 0), 1, -1)
    turned, length = polar((wide << left) >> 2, sign * ((high << left) >> 2))
    azimuth = turned + np.where(c < 0, TURN // 2, 0)
    # (|(c, s)|, a), normalised together.
    common = normalising_shift(any_part)
    across = ((length * PER_LENGTH) >> 32) >> (left - common)
    elevation, _ = polar(across, np.where(a < 0, -1, 1) * ((along << common) >> 2))
    elevation = np.clip(elevation, -QUARTER, QUARTER)
    if plan.zenith:
        first, second = QUARTER - elevation, (azimuth + TURN // 2) % TURN
    else:
        first, second = -elevation, (azimuth + TURN // 2) % TURN - TURN // 2
    first = np.where(any_part == 0, 0, first)
    second = np.where(across_any == 0, 0, second)
    return np.stack([first, second], axis=1), _status(plan, wide, high, along)


def normalising_shift(word: IntArray) -> IntArray:
    """How far 1 to 2^32 - 1 can be shifted left within 32 bits; 31 for 0."""
    shift = np.zeros_like(word)
    for step in (16, 8, 4, 2, 1):
        shift = np.where((word << (shift + step)) < TURN, shift + step, shift)
    return shift


def polar(x: IntArray, y: IntArray) -> tuple[IntArray, IntArray]:
    """Angle of (x, y), x >= 0, in units, within a quarter and its error, and K |(x, y)|.

    Rotations towards y = 0, then the digits of what y / x is left.
    """
    angle = np.full_like(x, START_UNITS)
    for i, units in enumerate(ROTATION_UNITS):
        up = y >= 0
        across = x >> i
        x = x + (np.where(up, y, -1 - y) >> i)
        y = np.where(up, y - across, y + across + 1)
        angle = np.where(up, angle + units, angle - units - 1)
    half = x >> 1
    rest, quotient = y << (ROTATIONS - 3), np.ones_like(x)
    for _ in range(DIGITS):
        up = rest >= 0
        rest = 2 * rest + np.where(up, -half, half + 1)
        quotient = 2 * quotient - np.where(up, 0, 1)
    return angle + ((quotient * QUOTIENT_UNITS) >> FRACTION), x


def _status(plan: AnglesPlan, wide: IntArray, high: IntArray, along: IntArray) -> IntArray:
    # Up to 3 * 2^62: beyond int64, within uint64.
    squares = [part.astype(np.uint64) ** 2 for part in (wide, high, along)]
    across = (squares[0] + squares[1]) >> np.uint64(1)
    total = (squares[0] + squares[1] + squares[2]) >> np.uint64(1)
    steep = across < np.uint64(plan.across_low)
    moved = (total < np.uint64(plan.rest_low)) | (total > np.uint64(plan.rest_high))
    status: IntArray = steep * STATUS_SECOND_ANGLE + moved * STATUS_NOT_AT_REST
    return status
