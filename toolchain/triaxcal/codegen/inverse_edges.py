"""Constants of the inverse form at its limits: least determinant, full rows, ties of rounding.

K is constant, and diagonal but for k_01, so that one element decides each: k_00 the determinant,
k_01 the gains of row x, U0_x its offset and with it the row's sum. Only a determinant beyond int32
needs k_10 as well. The values are found by
bisection with the Python model; whether an image of them is answered rightly is judged by the
reference C.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.fixedpoint.inversion import InverseShifts, invert, quarter_determinant, reciprocal
from triaxcal.model.types import IntArray

_TRIES = 64
"""Elements k_01 that are tried: each unit adds about one to the row's gains, until what is left of
the row's sum is even and within reach of the offset."""

TIES = 8
"""For each rounding constant: one gain off by one shows in one result of 2^output_shift / u."""

_SATURATING = tuple(range(1 << 20, (1 << 20) + TIES))
"""Elements k_01 whose square, over 2^31, takes the largest determinant past int32."""

Constants = tuple[str, int, int, int, int]
"""A name, k_00, k_01, U0_x and k_10; k_11 = k_22 is the largest that fits."""


def inverse_edges(
    shifts: InverseShifts, largest: int, preload: int, row_limit: int
) -> Iterator[Constants]:
    """Constants at the limits; a limit that this shape cannot reach is left out.

    `largest` is the magnitude that a constant may have, `preload` the rounding in the offset,
    `row_limit` that of step R.
    """
    least = shifts.determinant_min
    for determinant in (least - 2, least - 1, least, least + 1):
        k = _element(determinant, largest, shifts)
        if k is not None and _determinant(k, largest, shifts) == determinant:
            yield f"determinant {determinant}", k, 0, 0, 0
            yield f"determinant {determinant}, negative", -k, 0, 0, 0
    for k01 in _SATURATING:
        yield f"determinant above int32, k_01 {k01}", largest, k01, 0, -k01
        yield f"determinant below int32, k_01 {k01}", -largest, k01, 0, k01
    yield from itertools.islice(_gain_ties(largest, shifts), 2 * TIES)
    yield from itertools.islice(_offset_ties(largest, shifts, preload), 2 * TIES)
    k = _element(least, largest, shifts)
    if k is None:
        return
    for target, k00 in itertools.product((row_limit - 1, row_limit), (k, -k)):
        for k01 in range(_TRIES):
            u0 = _offset_at(target, (k00, k01), largest, shifts, preload)
            if u0 is not None:
                yield f"row at {target}, k_00 {k00}", k00, k01, u0, 0
                break


def _gain_ties(largest: int, shifts: InverseShifts) -> Iterator[Constants]:
    """Gains n_01 whose rounding is a tie, or one below it: a_01 times the reciprocal decides."""
    modulus = 1 << shifts.gain_shift
    for k00 in range(largest, largest - TIES * _TRIES, -1):
        inverse = _reciprocal(k00, largest, shifts)
        if inverse % 2 == 0:
            continue
        for remainder in (modulus // 2, modulus // 2 - 1):
            word = _signed(remainder * pow(inverse, -1, modulus), modulus)
            # a_01 is -(k_01 k_22) >> adjugate_shift.
            k01 = (-word << shifts.adjugate_shift) // largest
            if abs(k01) <= largest and (-k01 * largest) >> shifts.adjugate_shift == word:
                yield f"gain at remainder {remainder}, k_00 {k00}", k00, k01, 0, 0


def _offset_ties(largest: int, shifts: InverseShifts, preload: int) -> Iterator[Constants]:
    """Offsets U0_x whose rounding is a tie, or one below it: a quarter of n_00 U0_x decides."""
    for k00 in range(largest, largest - TIES * _TRIES, -1):
        n00 = int(invert(_functions((k00, 0), 0, largest), shifts, preload)[0][0, 0, 0])
        if n00 % 2 == 0:
            continue
        for remainder in (1 << 29, (1 << 29) - 1):
            # Odd, as 4 remainder + 0 of a tie has the one solution -2^31, which does not fit.
            u0 = _signed((4 * remainder + 1) * pow(n00, -1, 1 << 32), 1 << 32)
            if abs(u0) <= largest:
                yield f"offset at remainder {remainder}, k_00 {k00}", k00, 0, u0, 0


def _signed(value: int, modulus: int) -> int:
    """The number of least magnitude that is the value modulo `modulus`."""
    rest = value % modulus
    return rest - modulus if rest > modulus // 2 else rest


def _reciprocal(k00: int, largest: int, shifts: InverseShifts) -> int:
    return int(reciprocal(np.array([_determinant(k00, largest, shifts)]), shifts)[0])


def _offset_at(
    target: int, k: tuple[int, int], largest: int, shifts: InverseShifts, preload: int
) -> int | None:
    """U0_x that makes |n_0| + |n_1| + |n_2| + 2 |b| of row x equal to the target, or None."""

    def row(u0: int) -> tuple[int, int]:
        functions = _functions(k, u0, largest)
        gain, offset = invert(functions, shifts, preload)
        return int(np.abs(gain[0, 0]).sum()), abs(int(offset[0, 0]))

    # The sign for which the preloaded rounding makes the offset larger.
    sign = -1 if k[0] > 0 else 1
    offset, odd = divmod(target - row(0)[0], 2)
    if odd:
        return None
    magnitude = _first(1, largest, lambda v: row(sign * v)[1] >= offset)
    if magnitude is None or row(sign * magnitude)[1] != offset:
        return None
    return sign * magnitude


def _element(determinant: int, largest: int, shifts: InverseShifts) -> int | None:
    """Least k_00 whose determinant word is not below the given one."""
    return _first(1, largest, lambda v: _determinant(v, largest, shifts) >= determinant)


def _first(low: int, high: int, reached: Callable[[int], bool]) -> int | None:
    """Least value for which a growing function has been reached, or None."""
    if not reached(high):
        return None
    while low < high:
        middle = (low + high) // 2
        if reached(middle):
            high = middle
        else:
            low = middle + 1
    return low


def _functions(k: tuple[int, int], u0: int, largest: int) -> IntArray:
    functions = np.zeros((1, 3, 4), np.int64)
    functions[0, 0] = (*k, 0, u0)
    functions[0, 1, 1] = functions[0, 2, 2] = largest
    return functions


def _determinant(k00: int, largest: int, shifts: InverseShifts) -> int:
    """Determinant word of a diagonal K."""
    word = np.zeros((1, 3, 3), np.int64)
    word[0, 0, 0] = min((largest * largest) >> shifts.adjugate_shift, 2**31 - 1)
    quarter = quarter_determinant(_functions((k00, 0), 0, largest)[:, :, :3], word)
    return int(quarter[0]) >> shifts.determinant_shift
