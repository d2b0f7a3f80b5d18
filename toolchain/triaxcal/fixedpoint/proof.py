"""Proof of ranges and of the error bound, in integers and fractions only.

For each temperature code the routine's n and b are integers, and what they stand for are exact
rationals. The result is floor(y + 1/2) for y = (sum n u / 2^32 + b) / 2^spare, affine in u, so its
largest distance from the exact value over the raw box is that of a corner:

    error_i <= (sum_j |n_ij - n_ij exact| u_max / 2^32 + |b_i - b_i exact|) / 2^spare + 1/2.

Sums of high words have a floor for each product, which adds 1 before the division.

Every code of the working range is visited. docs/explanation/fixed-point.md, step E.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, chain, islice, pairwise, repeat

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
from triaxcal.fixedpoint.horner import Segment
from triaxcal.fixedpoint.integer_model import State, set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof_terms import (
    check_term_ranges,
    quadratic_errors,
    rate_errors,
    rate_reach,
    sensitivity_errors,
)
from triaxcal.fixedpoint.shape import FLOORS_LOSS
from triaxcal.model.types import IntArray

_GUARD_BITS = 20
"""Bits below a coefficient's last to which the worst code is looked for."""


@dataclass(frozen=True)
class Bound:
    """Proven error of the arithmetic against the real-valued model of the plan.

    Attributes
    ----------
    lsb : float
        Bound in output LSB, rounded up, largest over axes and temperature codes.
    per_axis_lsb : tuple of three floats
        The same for each axis.
    temp_code : int
        Where it is reached.
    codes : int
        Temperature codes visited: all of the working range.
    """

    lsb: float
    per_axis_lsb: tuple[float, float, float]
    temp_code: int
    codes: int


def prove(plan: Plan) -> Bound:
    """Check every range, then bound the error at every temperature code.

    Raises
    ------
    RefusedError
        When a range does not hold: a fault of the planner, never of the data.
    """
    check_ranges(plan)
    check_term_ranges(plan)
    codes = plan.temp_codes
    state, _ = set_temperature(plan, codes)
    _check_rows(plan, state)
    errors = _inverse_errors if plan.shape.inverse is not None else _direct_errors
    axes = [errors(plan, state, axis) for axis in range(3)]
    by_rate = rate_errors(plan)
    linear = [_sum_upwards(max(axis), r) for axis, r in zip(axes, by_rate, strict=True)]
    # An accelerometer has quadratic terms, a gyro a g-sensitivity: one of the two is nil.
    by_terms = [
        q + s
        for q, s in zip(
            quadratic_errors(plan, state, linear), sensitivity_errors(plan), strict=True
        )
    ]
    extra = np.array(by_rate) + by_terms
    worst = int((np.array(axes) + extra[:, None]).max(axis=0).argmax())
    per_axis = tuple(
        math.nextafter(_sum_upwards(error, more) + 0.5, math.inf)
        for error, more in zip(linear, by_terms, strict=True)
    )
    return Bound(
        lsb=max(per_axis),
        per_axis_lsb=(per_axis[0], per_axis[1], per_axis[2]),
        temp_code=int(codes[worst]),
        codes=len(codes),
    )


def _sum_upwards(error: float, more: float) -> float:
    return math.nextafter(error + more, math.inf) if more else error


def check_ranges(plan: Plan) -> None:
    """Bound every intermediate of Horner's rule over all x of its segment, as the loader does.

    |p_k| <= |c_k| + |p_(k+1)| / 2 + 1 for |x| < 2^31, and every such bound must fit int32.
    """
    ends = [s.first_code - 1 for s in plan.segments[1:]] + [plan.temp_max_code]
    for segment, last in zip(plan.segments, ends, strict=True):
        reach = max(last - segment.origin_code, segment.origin_code - segment.first_code)
        if reach * segment.gain > INT32_MAX:
            raise _broken(f"x at temperature code {last}")
        bounds = horner_bounds(segment)
        for f, bound in enumerate(bounds):
            if bound > INT32_MAX:
                raise _broken(FUNCTION_NAMES[plan.shape.form][f])
        if plan.shape.inverse is None:
            for row, more in enumerate(rate_reach(plan)):
                n0, n1, n2, b = bounds[4 * row : 4 * row + 4]
                if n0 + n1 + n2 + 2 * (b + more) >= plan.shape.row_limit:
                    raise _broken(f"row {row} of the sum")


def horner_bounds(segment: Segment) -> list[int]:
    """Bound of |p_0| of each function (the largest of |p_k| when that does not fit int32)."""
    bounds = []
    for row in segment.coefficients.tolist():
        bound = abs(row[-1])
        largest = bound
        for c in row[-2::-1]:
            bound = abs(c) + (bound >> 1) + 1
            largest = max(largest, bound)
        bounds.append(largest if largest > INT32_MAX else bound)
    return bounds


def _check_rows(plan: Plan, state: State) -> None:
    rows = np.abs(state.gain).sum(axis=2) + 2 * (np.abs(state.offset) + rate_reach(plan))
    if int(rows.max()) >= plan.shape.row_limit:
        raise _broken(f"the sum at output_q = {plan.shape.output_q}")


def _broken(what: str) -> RefusedError:
    return RefusedError(
        "range proof", f"{what} could overflow", remedy="this is a fault in triaxcal: report it"
    )


def _exact_values(plan: Plan, functions: Sequence[int]) -> tuple[list[list[int]], int]:
    """Exact values of functions at every code, as integers over 2^shift, and the shift."""
    segments = range(len(plan.segments))
    shift = max(_dyadic_shift(plan, s, f) for s in segments for f in functions)
    return [_exact_function(plan, f, shift) for f in functions], shift


def _exact_function(plan: Plan, function: int, shift: int) -> list[int]:
    values: list[int] = []
    ends = [s.first_code for s in plan.segments[1:]] + [plan.temp_max_code + 1]
    for s, (segment, end) in enumerate(zip(plan.segments, ends, strict=True)):
        x_shift = _x_shift(segment)
        scaled = [
            int(Fraction(float(c)) * Fraction(2) ** (shift - k * x_shift))
            for k, c in enumerate(plan.real[s, function])
        ]
        start = segment.first_code - segment.origin_code
        values += _tabulate(scaled, start, end - segment.first_code)
    return values


def _tabulate(coefficients: Sequence[int], start: int, count: int) -> list[int]:
    """Values of a polynomial at start, start + 1, ...: exact, by its finite differences.

    A polynomial of order n has a constant n-th difference, so every value costs n additions.
    """
    order = len(coefficients) - 1
    differences = []
    values = [_polynomial(coefficients, start + i) for i in range(order + 1)]
    while values:
        differences.append(values[0])
        values = [b - a for a, b in pairwise(values)]
    column: Iterable[int] = repeat(differences[-1], count)
    for first in differences[-2::-1]:
        column = accumulate(chain([first], column))
    return list(islice(column, count))


def _polynomial(coefficients: Sequence[int], at: int) -> int:
    value = 0
    for c in reversed(coefficients):
        value = value * at + c
    return value


def _x_shift(segment: Segment) -> int:
    """x / 2^31 is (code - origin_code) / 2^this."""
    return 31 - (segment.gain.bit_length() - 1)


def _dyadic_shift(plan: Plan, s: int, function: int) -> int:
    """Power of two that makes every coefficient, taken per code^k, an integer."""
    x_shift = _x_shift(plan.segments[s])
    return max(
        float(c).as_integer_ratio()[1].bit_length() - 1 + k * x_shift
        for k, c in enumerate(plan.real[s, function])
    )


def _direct_errors(plan: Plan, state: State, axis: int) -> list[float]:
    """Error in LSB, less the final 1/2, at every code that may be the worst; 0 elsewhere."""
    columns = [state.gain[:, axis, j] for j in range(3)]
    columns.append(state.offset[:, axis] - plan.shape.held_in_offset)
    exact, shift = _exact_values(plan, range(4 * axis, 4 * axis + 4))
    floors = FLOORS_LOSS << (shift + 32) if plan.shape.high_words else 0
    box = plan.shape.raw_box
    denominator = 1 << (shift + plan.shape.output_shift)
    errors = [0.0] * len(exact[0])
    for t in _candidates(columns, exact, shift, box):
        e0, e1, e2, eb = (
            abs((int(column[t]) << shift) - values[t])
            for column, values in zip(columns, exact, strict=True)
        )
        errors[t] = ((e0 + e1 + e2) * box + (eb << 32) + floors) / denominator
    return errors


def _candidates(
    columns: Sequence[IntArray], exact: Sequence[list[int]], shift: int, box: int
) -> list[int]:
    """Codes that the largest error may belong to, by distances known to 2^-20 of a coefficient."""
    drop = shift - _GUARD_BITS
    weights = (box, box, box, 1 << 32)
    total = np.zeros(len(columns[0]))
    for column, values, weight in zip(columns, exact, weights, strict=True):
        floor = [v >> drop for v in values] if drop >= 0 else [v << -drop for v in values]
        distance = np.abs((column << np.int64(_GUARD_BITS)) - np.array(floor, dtype=np.int64))
        total += distance.astype(np.float64) * float(weight)
    # Each distance is wrong by less than 1, and each of eight roundings by 2^-53 of the sum.
    slack = sum(weights) + 2.0**-50 * total.max()
    found: list[int] = np.flatnonzero(total >= total.max() - 2 * slack).tolist()
    return found


def _inverse_errors(plan: Plan, state: State, axis: int) -> list[float]:
    """Error in LSB, less the final 1/2, against the exact inverse at every code."""
    exact, shift = _exact_values(plan, range(12))
    shape = plan.shape
    assert shape.inverse is not None
    # K and its determinant are over 2^shift and 2^(3 shift); n = adj / det * 2^(shift + scale).
    scale = shape.inverse.scale_log2
    gain, offset = state.gain[:, axis].tolist(), state.offset[:, axis].tolist()
    errors = []
    for t in range(len(gain)):
        adjugate, determinant = _exact_adjugate_row([exact[f][t] for f in range(12)], axis)
        lift = max(0, -scale)
        unit = determinant << lift
        gain_error = sum(
            abs(n * unit - (a << (shift + scale + lift)))
            for n, a in zip(gain[t], adjugate, strict=True)
        )
        exact_offset = -sum(a * exact[4 * j + 3][t] for j, a in enumerate(adjugate))
        offset_error = abs(
            ((offset[t] - shape.rounding_in_offset) * unit << 32) - (exact_offset << (scale + lift))
        )
        denominator = abs(unit) << shape.output_shift
        errors.append((gain_error * shape.raw_box + offset_error) / denominator)
    return errors


def _exact_adjugate_row(functions: list[int], row: int) -> tuple[list[int], int]:
    """One row of the adjugate of K, and its determinant, of twelve functions in image order."""
    K = [functions[4 * i : 4 * i + 3] for i in range(3)]
    adjugate = []
    for j in range(3):
        a, b, c, d = (j + 1) % 3, (row + 1) % 3, (j + 2) % 3, (row + 2) % 3
        adjugate.append(K[a][b] * K[c][d] - K[a][d] * K[c][b])
    return adjugate, sum(adjugate[j] * K[j][row] for j in range(3))
