"""Constants of the inverse form at its limits: the least determinant, and rows at their limit.

K is diagonal but for k_01, and constant, so that one element decides each: k_00 the determinant,
k_01 the gains of row x, U0_x its offset and with it the row's sum. The values are found by
bisection with the Python model; whether an image of them is answered rightly is judged by the
reference C.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.fixedpoint.inversion import InverseShifts, invert, quarter_determinant
from triaxcal.model.types import IntArray

ROW_LIMIT = 2**32 - 8
_TRIES = 64
"""Elements k_01 that are tried: each unit adds about one to the row's gains, until what is left of
the row's sum is even and within reach of the offset."""

Constants = tuple[str, int, int, int]
"""A name, k_00, k_01 and U0_x; k_11 = k_22 is the largest that fits."""


def inverse_edges(shifts: InverseShifts, largest: int, preload: int) -> Iterator[Constants]:
    """Constants at the limits; a limit that this shape cannot reach is left out.

    `largest` is the magnitude that a constant may have, `preload` the rounding in the offset.
    """
    least = shifts.determinant_min
    for determinant in (least - 2, least - 1, least, least + 1):
        k = _element(determinant, largest, shifts)
        if k is not None and _determinant(k, largest, shifts) == determinant:
            yield f"determinant {determinant}", k, 0, 0
            yield f"determinant {determinant}, negative", -k, 0, 0
    k = _element(least, largest, shifts)
    if k is None:
        return
    for target, k00 in itertools.product((ROW_LIMIT - 1, ROW_LIMIT), (k, -k)):
        for k01 in range(_TRIES):
            u0 = _offset_at(target, (k00, k01), largest, shifts, preload)
            if u0 is not None:
                yield f"row at {target}, k_00 {k00}", k00, k01, u0
                break


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
