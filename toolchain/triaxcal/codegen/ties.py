"""Samples whose exact sum lies on the border between two results.

Only there does the last bit of a rounding constant, or the direction of a rounding, decide; random
samples meet a border once in 2^output_shift. Raw codes are found by solving
n_i0 u_0 + n_i1 u_1 + n_i2 u_2 + b_i 2^32 + rounding = 0 modulo 2^output_shift for one of them.
"""

from __future__ import annotations

from random import Random

import numpy as np

from triaxcal.fixedpoint.integer_model import set_temperature
from triaxcal.fixedpoint.plan import Plan

SEED = 20130528
PER_AXIS = 32
_TRIES = 64
"""A solution lies in the raw range once in eight tries or so; else the code is given up."""

Samples = tuple[np.ndarray[tuple[int], np.dtype[np.int32]],
                np.ndarray[tuple[int, int], np.dtype[np.int32]]]  # fmt: skip


def ties(plan: Plan, per_axis: int = PER_AXIS) -> Samples:
    """Temperature codes (n,) and raw codes (n, 3) on borders, up to `per_axis` for each axis.

    For each there is the same sample one raw code lower, where the range has it, and where the raw
    codes are not shifted one whose sum is one less than a border. None for sums of high words: one
    of 2^spare samples is on a border there.
    """
    rng = Random(SEED)
    shape = plan.shape
    if shape.high_words:
        return np.empty(0, np.int32), np.empty((0, 3), np.int32)
    codes = [rng.randint(plan.temp_min_code, plan.temp_max_code) for _ in range(per_axis)]
    state, _ = set_temperature(plan, np.array(codes, dtype=np.int64))
    rows = []
    for axis in range(3):
        for t, code in enumerate(codes):
            gain = [int(n) for n in state.gain[t, axis]]
            constant = (int(state.offset[t, axis]) << 32) + shape.rounding_in_sum
            raw = _solve(gain, constant, plan, rng)
            if raw is not None:
                rows.append([code, *raw])
                pivot = _pivot(gain)
                if raw[pivot] > shape.raw_min:
                    below = list(raw)
                    below[pivot] -= 1
                    rows.append([code, *below])
            if shape.raw_shift == 0:  # else every sum is even
                just_below = _solve(gain, constant + 1, plan, rng)
                if just_below is not None:
                    rows.append([code, *just_below])
    samples = np.array(rows, dtype=np.int32).reshape(-1, 4)
    return np.ascontiguousarray(samples[:, 0]), np.ascontiguousarray(samples[:, 1:])


def _pivot(gain: list[int]) -> int:
    """The gain with the fewest factors of two: it can be solved for most often."""
    return min(range(3), key=lambda j: _twos(gain[j]))


def _twos(value: int) -> int:
    return 64 if value == 0 else (value & -value).bit_length() - 1


def _solve(gain: list[int], constant: int, plan: Plan, rng: Random) -> list[int] | None:
    """Raw codes for which the sum is 0 modulo 2^output_shift, or None."""
    shape = plan.shape
    pivot = _pivot(gain)
    factor = _twos(gain[pivot]) + shape.raw_shift
    bits = shape.output_shift - factor
    if bits <= 0:
        return None
    inverse = pow(gain[pivot] >> _twos(gain[pivot]), -1, 1 << bits)
    for _ in range(_TRIES):
        raw = [rng.randint(shape.raw_min, shape.raw_max) for _ in range(3)]
        raw[pivot] = 0
        rest = constant + sum(n * (u << shape.raw_shift) for n, u in zip(gain, raw, strict=True))
        if rest % (1 << factor):
            continue
        wanted = (-(rest >> factor) * inverse) % (1 << bits)
        first = shape.raw_min + (wanted - shape.raw_min) % (1 << bits)
        if first <= shape.raw_max:
            raw[pivot] = first
            return raw
    return None
