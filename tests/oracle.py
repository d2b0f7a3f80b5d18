"""The routine of fixed-point.md, written from that page alone in unbounded integers.

Slow and obvious, and independent: nothing of triaxcal.fixedpoint is called, only a plan's fields
are read. Floors are floors of Fractions; int32 is a matter of `sat32` where the page says so, and
every other value is checked to fit the type in which the page promises it.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from triaxcal.fixedpoint.plan import Plan

TEMP_LOW, TEMP_HIGH, RAW_RANGE, SATURATED, BAD_IMAGE, RATE_RANGE = 1, 2, 4, 8, 16, 32
INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1

Rows = list[list[int]]
"""Three rows of the state: gains for x, y, z and the offset."""


def sat32(value: int) -> int:
    return min(max(value, INT32_MIN), INT32_MAX)


def floor_of(value: int, power: int) -> int:
    """floor(value / 2^power)."""
    return math.floor(Fraction(value, 2**power))


def trunc_of(value: int, divisor: int) -> int:
    return math.trunc(Fraction(value, divisor))


def int32(value: int) -> int:
    assert INT32_MIN <= value <= INT32_MAX, f"{value} does not fit int32"
    return value


def int64(value: int) -> int:
    assert -(2**63) <= value < 2**63, f"{value} does not fit int64"
    return value


def functions(plan: Plan, code: int) -> list[int]:
    """Step H: twelve functions at a clamped code."""
    segment = [s for s in plan.segments if s.first_code <= code][-1]
    x = int32((code - segment.origin_code) * segment.gain)
    values = []
    for row in segment.coefficients.tolist():
        p = int32(row[-1])
        for c in reversed(row[:-1]):
            p = int32(int32(c) + floor_of(int64(x * p), 32))
        values.append(p)
    return values


def set_temperature(plan: Plan, temp_code: int, rate_code: int = 0) -> tuple[Rows, int]:
    """Steps C, H, I, D: the state's rows and the status."""
    status = 0
    code = temp_code
    if code < plan.temp_min_code:
        code, status = plan.temp_min_code, TEMP_LOW
    elif code > plan.temp_max_code:
        code, status = plan.temp_max_code, TEMP_HIGH
    values = functions(plan, code)
    rows = [values[4 * i : 4 * i + 4] for i in range(3)]
    if plan.shape.form == "inverse":
        rows = inverted(plan, rows)
    if plan.rate is not None:
        rate = min(max(rate_code, plan.rate.min_code), plan.rate.max_code)
        status |= RATE_RANGE if rate != rate_code else 0
        w = int32(rate * plan.rate.gain)
        for row, r in zip(rows, plan.rate.words.tolist(), strict=True):
            more = int32(floor_of(int64(r * w + 2**31), 32))
            row[3] = sat32(row[3] + more)
    full = any(sum(map(abs, r[:3])) + 2 * abs(r[3]) >= row_limit(plan) for r in rows)
    if plan.shape.form == "inverse" and full:
        return [[0] * 4 for _ in range(3)], status | BAD_IMAGE
    return rows, status


def row_limit(plan: Plan) -> int:
    """Step R, point 3, 5 or 6."""
    terms = plan.quadratic is not None or plan.sensitivity is not None
    return 3 * 2**30 if terms else 2**32 - 8


def inverted(plan: Plan, rows: Rows) -> Rows:
    """Step I."""
    shifts = plan.shape.inverse
    assert shifts is not None
    k = [row[:3] for row in rows]
    u0 = [row[3] for row in rows]
    adj = [
        [sat32(floor_of(int64(cofactor(k, j, i)), shifts.adjugate_shift)) for j in range(3)]
        for i in range(3)
    ]
    det = int64(sum(floor_of(int64(k[0][j] * adj[j][0]), 2) for j in range(3)))
    det = sat32(floor_of(det, shifts.determinant_shift))
    magnitude = max(abs(det), 2 ** (shifts.reciprocal_log2 - 31) + 1)
    r = int32(trunc_of(2**shifts.reciprocal_log2, -magnitude if det < 0 else magnitude))
    spare = plan.shape.output_shift - 32
    preload = 2 ** (spare - 1) if spare >= 1 and plan.quadratic is None else 0
    result = []
    for i in range(3):
        n = [
            sat32(floor_of(int64(a * r + 2 ** (shifts.gain_shift - 1)), shifts.gain_shift))
            for a in adj[i]
        ]
        total = sum(floor_of(int64(n[j] * u0[j]), 2) for j in range(3))
        result.append([*n, sat32(preload - floor_of(int64(total + 2**29), 30))])
    return result


def cofactor(k: Rows, i: int, j: int) -> int:
    """Signed minor of element i, j: the row and the column struck out."""
    a, b, c, d = (k[r][s] for r in range(3) if r != i for s in range(3) if s != j)
    return (-1) ** (i + j) * (a * d - b * c)


def apply(
    plan: Plan, rows: Rows, raw: list[int], force: list[int] | None = None
) -> tuple[list[int], int]:
    """Steps A, Q and G, with the one formula that the page gives for two of three ways."""
    shape = plan.shape
    u = [min(max(code, shape.raw_min), shape.raw_max) for code in raw]
    status = 0 if u == raw else RAW_RANGE
    u = [int32(code * 2**shape.raw_shift) for code in u]
    accel = []
    if shape.high_words:
        for *n, b in rows:
            words = [int32(floor_of(int64(n[j] * u[j]), 32)) for j in range(3)]
            total = int32(int32(int32(words[0] + words[1]) + words[2]) + b)
            accel.append(floor_of(total, shape.output_shift - 32))
        return accel, status
    sums = [int64(n0 * u[0] + n1 * u[1] + n2 * u[2]) for n0, n1, n2, _ in rows]
    if plan.quadratic is not None:
        x, y, z = (int32(floor_of(s, 32) + row[3]) for s, row in zip(sums, rows, strict=True))
        pairs = [(x, x), (y, y), (z, z), (x, y), (x, z), (y, z)]
        p = [int32(floor_of(int64(v * w), 32)) for v, w in pairs]
        sums = [
            int64(s + int64(sum(q * v for q, v in zip(row, p, strict=True))))
            for s, row in zip(sums, plan.quadratic.tolist(), strict=True)
        ]
    if plan.sensitivity is not None and force is not None:
        sums = [
            int64(s + int64(sum(k * f for k, f in zip(row, force, strict=True))))
            for s, row in zip(sums, plan.sensitivity.tolist(), strict=True)
        ]
    for s, (*_, b) in zip(sums, rows, strict=True):
        total = int64(s + b * 2**32)
        if shape.output_shift <= 32 or plan.quadratic is not None:
            total = int64(total + 2 ** (shape.output_shift - 1))
        wide = floor_of(total, shape.output_shift)
        if shape.output_shift > 32:
            int32(wide)
        accel.append(sat32(wide))
        if accel[-1] != wide:
            status |= SATURATED
    return accel, status


def run(plan: Plan, temp_code: int, raw: list[int]) -> tuple[list[int], int]:
    """Both calls, their status or-ed."""
    rows, status = set_temperature(plan, temp_code)
    accel, sample = apply(plan, rows, raw)
    return accel, status | sample


# ---- step R and step E ----


def keeps_step_r(
    plan: Plan,
) -> bool:
    """Points 1 to 3 and 5 of step R, and segments that divide the range in rising order."""
    firsts = [s.first_code for s in plan.segments]
    quadratic = plan.quadratic is not None and max(np.abs(plan.quadratic).sum(axis=1)) > 2**31 - 1
    if quadratic or firsts[0] != plan.temp_min_code or sorted(set(firsts)) != firsts:
        return False
    lasts = [f - 1 for f in firsts[1:]] + [plan.temp_max_code]
    for segment, first, last in zip(plan.segments, firsts, lasts, strict=True):
        if first > last or segment.gain < 1:
            return False
        reach = max(abs(code - segment.origin_code) for code in (first, last))
        if reach * segment.gain > INT32_MAX:
            return False
        bounds = []
        for row in segment.coefficients.tolist():
            bound = abs(row[-1])
            largest = bound
            for c in reversed(row[:-1]):
                bound = abs(c) + math.floor(Fraction(bound, 2)) + 1
                largest = max(largest, bound)
            if largest > INT32_MAX:
                return False
            bounds.append(bound)
        for n0, n1, n2, b in (bounds[i : i + 4] for i in (0, 4, 8)):
            if plan.shape.form == "direct" and n0 + n1 + n2 + 2 * b >= row_limit(plan):
                return False
    return True


def real_rows(plan: Plan, code: int) -> list[list[Fraction]]:
    """What the twelve functions stand for at a code of the range: exact, of the plan's floats."""
    s = max(i for i, segment in enumerate(plan.segments) if segment.first_code <= code)
    segment = plan.segments[s]
    x = Fraction((code - segment.origin_code) * segment.gain, 2**31)
    values = [
        sum((Fraction(float(c)) * x**k for k, c in enumerate(row)), Fraction(0))
        for row in plan.real[s]
    ]
    return [values[4 * i : 4 * i + 4] for i in range(3)]


def real_gain_and_offset(plan: Plan, code: int) -> list[list[Fraction]]:
    """n* and b* of step E: of the direct form as they are, of the inverse form K^-1 and -K^-1 U0.

    With r = 2^log2 / det and det a quarter of det K over 2^(adjugate + determinant shifts), step I
    makes the gain's integer 2^(log2 + 2 + determinant_shift - gain_shift) times K's inverse.
    """
    rows = real_rows(plan, code)
    shifts = plan.shape.inverse
    if shifts is None:
        return rows
    scale = Fraction(2) ** (
        shifts.reciprocal_log2 + 2 + shifts.determinant_shift - shifts.gain_shift
    )
    k = [row[:3] for row in rows]
    det = sum(k[0][j] * cofactor(k, 0, j) for j in range(3))
    inverse = [[scale * cofactor(k, j, i) / det for j in range(3)] for i in range(3)]
    return [[*n, -sum(n[j] * rows[j][3] for j in range(3)) / 2**32] for n in inverse]


def real_accel(plan: Plan, rows: list[list[Fraction]], raw: list[int]) -> list[Fraction]:
    """Exact acceleration in output LSB of raw codes within the declared range."""
    u = [code * 2**plan.shape.raw_shift for code in raw]
    force = [sum((row[j] * u[j] for j in range(3)), Fraction(0)) / 2**32 + row[3] for row in rows]
    if plan.real_quadratic is not None:
        x, y, z = force
        p = [x * x, y * y, z * z, x * y, x * z, y * z]
        force = [
            v + sum(Fraction(q) * w for q, w in zip(row, p, strict=True)) / 2**64
            for v, row in zip(force, plan.real_quadratic.tolist(), strict=True)
        ]
    return [v / Fraction(2) ** (plan.shape.output_shift - 32) for v in force]


def error_bound(plan: Plan, code: int) -> list[Fraction]:
    """Step E's bound of each axis at one code, in output LSB, but for what quadratic terms add."""
    found, _ = set_temperature(plan, code)
    spare = plan.shape.output_shift - 32
    preload = 2 ** (spare - 1) if spare >= 1 and plan.quadratic is None else 0
    u_max = max(abs(plan.shape.raw_min), abs(plan.shape.raw_max)) * 2**plan.shape.raw_shift
    bounds = []
    for n, exact in zip(found, real_gain_and_offset(plan, code), strict=True):
        gain = sum(abs(n[j] - exact[j]) for j in range(3))
        # Three floors lose 0, 1 or 2 more than one: 1 is held, and may be wrong by 1.
        floors = 1 if plan.shape.high_words else 0
        offset = abs(n[3] - preload - floors - exact[3])
        before = gain * u_max / 2**32 + offset + floors
        bounds.append(before / Fraction(2) ** spare + Fraction(1, 2))
    return bounds


def quadratic_extra(plan: Plan) -> list[Fraction]:
    """What quadratic terms add to step E's bound of each axis, in output LSB."""
    assert plan.quadratic is not None
    assert plan.real_quadratic is not None
    spare = Fraction(2) ** (plan.shape.output_shift - 32)
    u_max = max(abs(plan.shape.raw_min), abs(plan.shape.raw_max)) * 2**plan.shape.raw_shift
    e, h = [Fraction(0)] * 3, [Fraction(0)] * 3
    for code in plan.temp_codes.tolist():
        rows, _ = set_temperature(plan, code)
        bounds = error_bound(plan, code)
        for j, row in enumerate(rows):
            e[j] = max(e[j], (bounds[j] - Fraction(1, 2)) * spare + 1)
            n = sum(map(abs, row[:3])) * u_max
            h[j] = max(h[j], Fraction(n // 2**32 + 1 + abs(row[3])))
    extras = []
    for i in range(3):
        total = Fraction(0)
        for k, (j, m) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
            q, exact = int(plan.quadratic[i, k]), Fraction(float(plan.real_quadratic[i, k]))
            l_j, l_m = h[j] + e[j], h[m] + e[m]
            d = (e[j] * h[m] + l_j * e[m]) / 2**32 + 1
            total += (abs(q - exact) * l_j * l_m / 2**32 + abs(q) * d) / 2**32
        extras.append(total / spare)
    return extras
