"""The proven bound is one, is nearly reached and notices faults; ranges hold or are refused."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from plans import (
    COVERING,
    GOLDEN,
    INT32_MAX,
    TABLE_SLOPES,
    TABLE_T0,
    integer_plan,
    integer_shape,
    polynomial_model,
    random_plan,
    random_quadratic,
    random_rows,
    unit_of,
    with_quadratic,
)
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.unit import Delivery
from triaxcal.fixedpoint import integer_model
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import check_ranges, prove
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.method import DIRECT
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.metrological import exact_gain_and_offset, pack_constants
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermometer import TemperatureSensor

COARSE = TemperatureSensor(degc_per_code=2.5, degc_at_zero=0.0)
"""45 codes from -40 to 70 degC: few enough for fractions."""
SQUARES = [1e-2 * slope for slope in TABLE_SLOPES]


def planned(unit: UnitDescription, thermal: ThermalModel) -> Plan:
    adc = unit.adc
    voltage_max_v = max(abs(adc.code_min), abs(adc.code_max)) * adc.volts_per_code
    return make_plan(compensate(thermal, unit.method, (-40.0, 70.0), voltage_max_v, 1e-6), unit)


def three_segments() -> ThermalModel:
    rows = [np.array([TABLE_T0, [k * s for s in TABLE_SLOPES]]).T for k in (1.0, 1.5, 0.7)]
    curves = PiecewisePolynomial((-40.0, 0.0, 20.0, 70.0), (20.0,) * 3, np.array(rows))
    return ThermalModel(20.0, curves)


def coarse_plans() -> dict[str, Plan]:
    """Plans of the planner, of every method and kind of range, with few temperature codes."""
    quadratic = polynomial_model(TABLE_T0, TABLE_SLOPES, SQUARES)
    plans = {
        f"{method}, {label}": planned(replace(unit, method=method), quadratic)
        for method in METHODS.names
        for label, unit in {
            "24 bits": unit_of(sensor=COARSE),
            "32 bits saturating": unit_of(sensor=COARSE, bits=32, output_q=28),
            "narrow range": unit_of(sensor=COARSE, codes=(-1_000_000, 7_654_321)),
        }.items()
    }
    for method in ("matrix", "inverse"):
        plans[f"{method}, segments"] = planned(
            unit_of(sensor=COARSE, method=method), three_segments()
        )
    return plans


PLANS = coarse_plans()


# ---- the bound ----


@pytest.mark.parametrize("name", PLANS)
def test_bound_is_step_e_at_the_worst_code_rounded_up(name: str) -> None:
    plan = PLANS[name]
    bound = prove(plan)
    by_code = [oracle.error_bound(plan, code) for code in plan.temp_codes.tolist()]
    for axis in range(3):
        exact = max(bounds[axis] for bounds in by_code)
        # A division and a sum, each rounded to 1/2 unit in the last place, then one place up.
        assert exact <= Fraction(bound.per_axis_lsb[axis]) <= exact * (1 + Fraction(1, 2**51))
    assert bound.lsb == max(bound.per_axis_lsb)
    assert bound.codes == len(by_code) == plan.temp_max_code - plan.temp_min_code + 1
    worst = [max(bounds) for bounds in by_code]
    assert worst[bound.temp_code - plan.temp_min_code] == max(worst)


@pytest.mark.parametrize("name", PLANS)
def test_no_sample_exceeds_the_bound(name: str) -> None:
    plan = PLANS[name]
    bound = [Fraction(lsb) for lsb in prove(plan).per_axis_lsb]
    rng = Random(name)
    low, high = plan.shape.raw_min, plan.shape.raw_max
    corners = [list(corner) for corner in itertools.product((low, high), repeat=3)]
    compared = 0
    for code in plan.temp_codes.tolist():
        rows, status = oracle.set_temperature(plan, code)
        assert status == 0
        real = oracle.real_gain_and_offset(plan, code)
        for raw in [*corners, *([rng.randint(low, high) for _ in range(3)] for _ in range(8))]:
            found, status = oracle.apply(plan, rows, raw)
            exact = oracle.real_accel(plan, real, raw)
            for axis in range(3):
                if status == 0:
                    assert abs(found[axis] - exact[axis]) <= bound[axis], (code, raw)
                    compared += 1
    assert compared > 1000


@settings(max_examples=40)
@given(
    name=st.sampled_from([n for n, s in COVERING.items() if s.form == DIRECT]),
    seed=st.integers(0, 2**32),
    rounded_by=st.floats(-3.0, 3.0),
)
def test_bound_holds_for_any_constants(name: str, seed: int, rounded_by: float) -> None:
    rng = Random(seed)
    shape = COVERING[name]
    rows = [
        random_rows(rng, shape.order, full=rng.random() < 0.3, limit=shape.row_limit)
        for _ in range(shape.segments)
    ]
    low = rng.randint(-(2**29), 2**29)
    plan = integer_plan(shape, rows, (low, low + 40), rounded_by=rounded_by)
    if shape.quadratic:
        words = random_quadratic(rng, full=rng.random() < 0.3)
        plan = with_quadratic(plan, words, rounded_by)
    bound = [Fraction(lsb) for lsb in prove(plan).per_axis_lsb]
    for _ in range(30):
        code = rng.randint(plan.temp_min_code, plan.temp_max_code)
        raw = [rng.choice([shape.raw_min, shape.raw_max]) for _ in range(3)]
        found, status = oracle.run(plan, code, raw)
        exact = oracle.real_accel(plan, oracle.real_gain_and_offset(plan, code), raw)
        if status == 0:
            assert all(abs(f - e) <= b for f, e, b in zip(found, exact, bound, strict=True)), (
                code,
                raw,
            )


def worst_corner_error(plan: Plan) -> float:
    """Largest error at the corners of the raw box, every temperature code, in LSB.

    Floats find the worst twenty of all; fractions confirm them.
    """
    codes = plan.temp_codes
    state, _ = integer_model.set_temperature(plan, codes)
    rows = plan.real_rows()
    shape = plan.shape
    candidates = []
    for corner in itertools.product((shape.raw_min, shape.raw_max), repeat=3):
        raw = np.tile(np.array(corner, dtype=np.int64), (len(codes), 1))
        accel, status = integer_model.apply(plan, state, raw)
        u = np.array(corner) * 2.0 ** (shape.raw_shift - 32)
        exact = (rows[:, :, :3] @ u + rows[:, :, 3]) * 2.0 ** (32 - shape.output_shift)
        error = np.where(status[:, None] == 0, np.abs(accel - exact), 0.0).max(axis=1)
        candidates += [(float(error[t]), int(codes[t]), list(corner)) for t in error.argsort()[-5:]]
    worst = Fraction(0)
    for _, code, raw in sorted(candidates)[-20:]:
        found, _ = oracle.run(plan, code, raw)
        exact_accel = oracle.real_accel(plan, oracle.real_gain_and_offset(plan, code), raw)
        worst = max(worst, *(abs(f - e) for f, e in zip(found, exact_accel, strict=True)))
    return float(worst)


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_shipped_units_stay_within_one_lsb_and_come_near_the_bound(
    delivered: dict[str, Delivery], unit: str
) -> None:
    delivery = delivered[unit]
    assert delivery.plan.shape.output_q == 24
    assert delivery.bound.lsb <= 1.0
    assert 0.8 * delivery.bound.lsb <= delivery.check.largest_error_lsb <= delivery.bound.lsb
    worst = worst_corner_error(delivery.plan)
    assert 0.8 * delivery.bound.lsb <= worst <= delivery.bound.lsb
    # The lattice of the cross-check holds every corner at every code: it saw the worst as well.
    assert delivery.check.largest_error_lsb >= worst - 1e-6  # floats of 2^31 LSB: 2^-21


@pytest.mark.parametrize("order", [3, 5, 7])
def test_polynomial_form_of_any_order_stays_within_one_lsb(order: int) -> None:
    # N(T) and b(T) of constants of the tables' size, forced to an order, steeper than they are.
    thermal = polynomial_model(TABLE_T0, [3 * s for s in TABLE_SLOPES], SQUARES)
    half, middle = 55.0, 15.0
    x = np.cos(np.pi * (np.arange(order + 1) + 0.5) / (order + 1))
    values = pack_constants(*exact_gain_and_offset(thermal.constants_at(middle + half * x)))
    in_x = np.linalg.solve(np.vander(x, increasing=True), values)
    coefficients = (in_x / half ** np.arange(order + 1)[:, None]).T[None]
    curves = PiecewisePolynomial((-40.0, 70.0), (middle,), coefficients)
    plan = make_plan(Compensation("matrix", DIRECT, curves), unit_of())
    assert plan.shape.order == order
    bound = prove(plan)
    assert bound.lsb <= 1.0
    assert 0.8 * bound.lsb <= worst_corner_error(plan) <= bound.lsb


def test_half_a_lsb_is_the_floor_of_every_bound() -> None:
    # Constants that are their own real values: nothing is left but the final rounding.
    plan = integer_plan(integer_shape(order=0), [[[5 * f] for f in range(12)]], (0, 3))
    assert prove(plan).lsb == np.nextafter(0.5, 1.0)


# ---- a fault in the constants raises it ----


def corrupted(plan: Plan, s: int, f: int, k: int, change: int) -> Plan:
    coefficients = plan.segments[s].coefficients.copy()
    coefficients[f, k] += change
    segments = list(plan.segments)
    segments[s] = replace(segments[s], coefficients=coefficients)
    return replace(plan, segments=tuple(segments))


@pytest.mark.parametrize("name", ["matrix, 24 bits", "matrix, segments", "inverse, 24 bits"])
def test_a_corrupted_coefficient_raises_the_bound_of_its_axis(name: str) -> None:
    plan = PLANS[name]
    good = prove(plan).per_axis_lsb
    for s, f, k in itertools.product(
        range(plan.shape.segments), range(12), range(plan.shape.order + 1)
    ):
        for bit in (k + 9, k + 20):
            for sign in (-1, 1):
                bad = prove(corrupted(plan, s, f, k, sign << bit)).per_axis_lsb
                axis = f // 4
                if plan.shape.form == DIRECT:
                    assert bad[axis] > good[axis], (s, f, k, sign << bit)
                    others = [a for a in range(3) if a != axis]
                    assert all(bad[a] == good[a] for a in others)
                else:  # K's inverse mixes the rows
                    assert max(b - g for b, g in zip(bad, good, strict=True)) > 0.0


@pytest.mark.parametrize("name", ["matrix, 24 bits", "matrix, segments"])
def test_one_place_more_or_less_in_a_constant_term_is_noticed(name: str) -> None:
    # The bound is convex in a coefficient's error, whatever the codes it is taken over: one of
    # the two directions must raise it.
    plan = PLANS[name]
    for s, f in itertools.product(range(plan.shape.segments), range(12)):
        codes = plan.temp_codes
        inside = [c for c in codes.tolist() if oracle_segment(plan, c) == s][::4]
        before = max(oracle.error_bound(plan, c)[f // 4] for c in inside)
        after = [
            max(oracle.error_bound(corrupted(plan, s, f, 0, d), c)[f // 4] for c in inside)
            for d in (-1, 1)
        ]
        assert max(after) > before, (s, f)
        changed = [prove(corrupted(plan, s, f, 0, d)).per_axis_lsb[f // 4] for d in (-1, 1)]
        assert max(changed) >= prove(plan).per_axis_lsb[f // 4]


def oracle_segment(plan: Plan, code: int) -> int:
    return max(i for i, s in enumerate(plan.segments) if s.first_code <= code)


# ---- ranges ----


def interval(plan: Plan, s: int, f: int) -> list[tuple[int, int]]:
    """Exact interval of each p_k over every x of the segment, taken one step at a time."""
    segment = plan.segments[s]
    last = plan.segments[s + 1].first_code - 1 if s + 1 < len(plan.segments) else plan.temp_max_code
    xs = [(c - segment.origin_code) * segment.gain for c in (segment.first_code, last)]
    row = segment.coefficients[f].tolist()
    reached = [(row[-1], row[-1])]
    for c in reversed(row[:-1]):
        ends = [oracle.floor_of(x * p, 32) for x in xs for p in reached[-1]]
        reached.append((c + min(ends), c + max(ends)))
    return reached


@settings(max_examples=100)
@given(
    name=st.sampled_from([*COVERING]),
    seed=st.integers(0, 2**32),
    over=st.integers(-2, 3),
)
def test_check_ranges_agrees_with_step_r_at_its_limits(name: str, seed: int, over: int) -> None:
    rng = Random(seed)
    plan = random_plan(rng, COVERING[name], full=True)
    s, f = rng.randrange(plan.shape.segments), rng.randrange(12)
    k = rng.randrange(plan.shape.order + 1)
    c = int(plan.segments[s].coefficients[f, k])
    plan = corrupted(plan, s, f, k, over if c >= 0 else -over)
    if not oracle.keeps_step_r(plan):
        with pytest.raises(RefusedError, match="could overflow"):
            check_ranges(plan)
        return
    check_ranges(plan)
    for segment in range(plan.shape.segments):
        final = []
        for function in range(12):
            reached = interval(plan, segment, function)
            assert all(low >= -(2**31) and high < 2**31 for low, high in reached)
            final.append(max(abs(end) for end in reached[-1]))
        if plan.shape.form == DIRECT:
            for i in (0, 4, 8):
                # |u| <= 2^31; rounding at most 2^31 (output_shift <= 32).
                largest = sum(final[i : i + 3]) * 2**31 + final[i + 3] * 2**32 + 2**31
                assert largest < 2**63


def test_both_verdicts_of_the_limit_are_met() -> None:
    shape = COVERING["direct-cubic-24-bit"]
    verdicts = set()
    for seed in range(20):
        plan = random_plan(Random(seed), shape, full=True)
        check_ranges(plan)
        sign = 1 if plan.segments[0].coefficients[3, 0] >= 0 else -1
        try:
            check_ranges(corrupted(plan, 0, 3, 0, sign * 4))
            verdicts.add("kept")
        except RefusedError:
            verdicts.add("refused")
    assert "refused" in verdicts


def test_x_beyond_q31_is_refused() -> None:
    plan = GOLDEN["direct-checked"]
    segment = plan.segments[0]
    too_fast = replace(plan, segments=(replace(segment, gain=2 * segment.gain),))
    with pytest.raises(RefusedError, match="x at temperature code 8960 could overflow"):
        prove(too_fast)


def test_gains_of_an_inversion_that_do_not_fit_are_refused() -> None:
    # Nothing answers to z, so the determinant is zero and the last row of the adjugate is full.
    no, k = [0, 0, 0], [INT32_MAX - 15, 0, 0]
    rows = [k, no, no, no, no, k, no, no, k, k, no, no]
    broken = integer_plan(COVERING["inverse-order-2"], [rows], (0, 3))
    check_ranges(broken)
    with pytest.raises(RefusedError, match="the sum at output_q = 24 could overflow"):
        prove(broken)
