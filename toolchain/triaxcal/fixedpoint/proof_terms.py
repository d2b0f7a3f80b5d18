"""Proof of range and error of the terms beyond the linear; fixed-point.md, steps R and E."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.gyro import SENSITIVITY_LIMIT
from triaxcal.fixedpoint.integer_model import State
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_LIMIT
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES


def check_term_ranges(plan: Plan) -> None:
    """Step R, points 5 and 6: the words of a row, as the loader checks them.

    Raises
    ------
    RefusedError
        When a row does not fit: a fault of the planner, never of the data.
    """
    for words, limit, what in (
        (plan.quadratic, QUADRATIC_LIMIT, "quadratic terms"),
        (plan.sensitivity, SENSITIVITY_LIMIT, "g-sensitivities"),
    ):
        sums = [0] if words is None else np.abs(words).sum(axis=1).tolist()
        if max(sums) > limit:
            raise RefusedError(
                "range proof",
                f"the {what} of axis {AXES[sums.index(max(sums))]} could overflow",
                remedy="this is a fault in triaxcal: report it",
            )


def quadratic_errors(plan: Plan, state: State, linear_lsb: Sequence[float]) -> list[float]:
    """What the quadratic terms add to each axis' error, in output LSB, rounded up.

    `linear_lsb` is the largest error of each axis before its final floor, in output LSB.
    """
    if plan.quadratic is None or plan.real_quadratic is None:
        return [0.0, 0.0, 0.0]
    place = Fraction(2) ** (plan.shape.output_shift - 32)  # of h, per output LSB
    # Each was rounded to nearest: the next float is not below what it stands for.
    error = [Fraction(math.nextafter(lsb, math.inf)) * place + 1 for lsb in linear_lsb]
    reach = [_reach(plan, state, axis) for axis in range(3)]
    exact_reach = [h + e for h, e in zip(reach, error, strict=True)]
    result = []
    for row, real in zip(plan.quadratic.tolist(), plan.real_quadratic.tolist(), strict=True):
        total = Fraction(0)
        for q, exact, (a, b) in zip(row, real, PRODUCT_AXES, strict=True):
            product = (error[a] * reach[b] + exact_reach[a] * error[b]) / 2**32 + 1
            total += abs(q - Fraction(exact)) * exact_reach[a] * exact_reach[b] / 2**32
            total += abs(q) * product
        result.append(math.nextafter(float(total / 2**32 / place), math.inf))
    return result


def sensitivity_errors(plan: Plan) -> list[float]:
    """What the rounding of a gyro's g-sensitivity adds to each axis' error, in LSB, rounded up.

    For any int32 of specific force, taken as it is.
    """
    if plan.sensitivity is None or plan.real_sensitivity is None:
        return [0.0, 0.0, 0.0]
    unit = Fraction(2) ** (31 - plan.shape.output_shift)
    sums = [
        sum(abs(k - Fraction(exact)) for k, exact in zip(row, real, strict=True))
        for row, real in zip(plan.sensitivity.tolist(), plan.real_sensitivity.tolist(), strict=True)
    ]
    return [math.nextafter(float(s * unit), math.inf) if s else 0.0 for s in sums]


def rate_reach(plan: Plan) -> list[int]:
    """Bound of what a term in dT/dt adds to each offset: |r w| / 2^32 + 1/2, |w| < 2^31."""
    if plan.rate is None:
        return [0, 0, 0]
    return [abs(word) // 2 + 1 for word in plan.rate.words.tolist()]


def rate_errors(plan: Plan) -> list[float]:
    """What a term in dT/dt adds to each axis' error, in output LSB, rounded up."""
    if plan.rate is None:
        return [0.0, 0.0, 0.0]
    place = Fraction(2) ** (plan.shape.output_shift - 32)
    errors = [
        (abs(word - Fraction(exact)) * plan.rate.reach / 2**32 + Fraction(1, 2)) / place
        for word, exact in zip(plan.rate.words.tolist(), plan.rate.real.tolist(), strict=True)
    ]
    return [math.nextafter(float(error), math.inf) for error in errors]


def _reach(plan: Plan, state: State, axis: int) -> int:
    """Bound of |h| over all codes and the raw box."""
    gain: list[int] = np.abs(state.gain[:, axis]).sum(axis=1).tolist()
    offset: list[int] = np.abs(state.offset[:, axis]).tolist()
    box = plan.shape.raw_box
    more = rate_reach(plan)[axis]
    return more + max(n * box // 2**32 + 1 + b for n, b in zip(gain, offset, strict=True))
