"""What one answer should be, in fractions: the plan's real functions without a float's rounding."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from triaxcal.fixedpoint.horner import segment_of
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.terms import PRODUCT_AXES


def exact_error_lsb(
    plan: Plan,
    temp_code: int,
    raw_code: Sequence[int],
    axis: int,
    answer: int,
    *,
    rate_code: int = 0,
    force_code: Sequence[int] = (0, 0, 0),
) -> float:
    """Signed error of one axis' answer in output LSB, rounded once.

    `temp_code` and `rate_code` lie in their ranges; the answer is one that no limit touched.
    `force_code` is what a gyro's g-sensitivity takes.
    """
    exact = _linear(plan, temp_code, raw_code, axis, rate_code)
    if plan.real_quadratic is not None:
        linear = [_linear(plan, temp_code, raw_code, i, rate_code) for i in range(3)]
        for word, (a, b) in zip(plan.real_quadratic[axis].tolist(), PRODUCT_AXES, strict=True):
            exact += Fraction(word) * linear[a] * linear[b] / 2**64
    if plan.real_sensitivity is not None:
        for word, force in zip(plan.real_sensitivity[axis].tolist(), force_code, strict=True):
            exact += Fraction(word) * force / 2**32
    return float(answer - exact * Fraction(2) ** (32 - plan.shape.output_shift))


def _linear(
    plan: Plan, temp_code: int, raw_code: Sequence[int], axis: int, rate_code: int
) -> Fraction:
    """The linear result of one axis, in units of the state's offset."""
    row = exact_row(plan, temp_code, axis)
    scale = Fraction(2) ** (plan.shape.raw_shift - 32)
    total = row[3] + sum((n * u * scale for n, u in zip(row, raw_code, strict=False)), Fraction(0))
    if plan.rate is not None:
        total += Fraction(float(plan.rate.real[axis])) * rate_code * plan.rate.gain / 2**32
    return total


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
