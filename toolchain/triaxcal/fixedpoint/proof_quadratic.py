"""Proof of range and error of the quadratic terms; docs/fixed-point.md, steps R and E."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from triaxcal.errors import RefusedError
from triaxcal.fixedpoint.integer_model import State
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_LIMIT
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES


def check_quadratic_range(plan: Plan) -> None:
    """Step R, point 5: the words of a row, as the loader checks them.

    Raises
    ------
    RefusedError
        When a row does not fit: a fault of the planner, never of the data.
    """
    if plan.quadratic is None:
        return
    sums = np.abs(plan.quadratic).sum(axis=1)
    if int(sums.max()) > QUADRATIC_LIMIT:
        raise RefusedError(
            "range proof",
            f"the quadratic terms of axis {AXES[int(sums.argmax())]} could overflow",
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


def _reach(plan: Plan, state: State, axis: int) -> int:
    """Bound of |h| over all codes and the raw box."""
    gain: list[int] = np.abs(state.gain[:, axis]).sum(axis=1).tolist()
    offset: list[int] = np.abs(state.offset[:, axis]).tolist()
    box = plan.shape.raw_box
    return max(n * box // 2**32 + 1 + b for n, b in zip(gain, offset, strict=True))
