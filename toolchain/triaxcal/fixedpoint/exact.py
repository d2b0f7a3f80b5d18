"""What one answer should be, in fractions: the plan's real functions without a float's rounding."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from triaxcal.fixedpoint.horner import segment_of
from triaxcal.fixedpoint.plan import Plan


def exact_error_lsb(
    plan: Plan, temp_code: int, raw_code: Sequence[int], axis: int, answer: int
) -> float:
    """Signed error of one axis' answer in output LSB, rounded once.

    `temp_code` lies in the working range; the answer is one that no limit touched.
    """
    shape = plan.shape
    row = exact_row(plan, temp_code, axis)
    scaled = [Fraction(u) * Fraction(2) ** (shape.raw_shift - 32) for u in raw_code]
    exact = row[3] + sum((n * u for n, u in zip(row, scaled, strict=False)), Fraction(0))
    return float(answer - exact * Fraction(2) ** (32 - shape.output_shift))


def exact_row(plan: Plan, temp_code: int, axis: int) -> list[Fraction]:
    """What an axis' three gains and its offset stand for at one code, as `Plan.real_rows`."""
    s = int(segment_of(plan.segments, np.array([temp_code]))[0])
    segment = plan.segments[s]
    x = Fraction((temp_code - segment.origin_code) * segment.gain, 2**31)
    values = []
    for coefficients in plan.real[s].tolist():
        value = Fraction(0)
        for c in reversed(coefficients):
            value = value * x + Fraction(c)
        values.append(value)
    rows = [values[4 * i : 4 * i + 4] for i in range(3)]
    if plan.shape.inverse is None:
        return rows[axis]
    unit = Fraction(2) ** plan.shape.inverse.scale_log2
    N = [n * unit for n in _inverse_row([row[:3] for row in rows], axis)]
    offset = -sum((n * row[3] for n, row in zip(N, rows, strict=True)), Fraction(0))
    return [*N, offset / 2**32]


def _inverse_row(K: list[list[Fraction]], axis: int) -> list[Fraction]:
    """Row `axis` of the inverse of K, (3, 3), by cofactors."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    cofactors = []
    for j in range(3):
        c, d = (j + 1) % 3, (j + 2) % 3
        cofactors.append(K[c][a] * K[d][b] - K[c][b] * K[d][a])
    determinant = sum((K[j][axis] * cofactors[j] for j in range(3)), Fraction(0))
    return [c / determinant for c in cofactors]
