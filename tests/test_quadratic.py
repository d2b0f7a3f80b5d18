"""Quadratic terms from floats to C: plan, proven bound, cross-check, and what is refused."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np
import pytest

import oracle
from builds import write_generated
from plans import (
    SENSOR,
    TABLE_SLOPES,
    TABLE_T0,
    integer_plan,
    integer_shape,
    polynomial_model,
    unit_of,
    with_quadratic,
)
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.crosscheck import cross_check, vector_sets
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import check_images, image_cases
from triaxcal.codegen.routines import Generated, Reference, start_generated
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import make_plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.terms import EXAMPLE_TERMS, Terms
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermometer import TemperatureSensor

COARSE = TemperatureSensor(degc_per_code=2.5, degc_at_zero=0.0)
"""45 codes from -40 to 70 degC: few enough for fractions."""
assert EXAMPLE_TERMS.quadratic_per_g is not None
Q = EXAMPLE_TERMS.quadratic_per_g
UNITS = {
    "24 bits": unit_of(sensor=COARSE),
    "inverse": unit_of(sensor=COARSE, method="inverse"),
    "32 bits saturating": unit_of(sensor=COARSE, bits=32, output_q=28),
    "inverse saturating": unit_of(sensor=COARSE, bits=32, output_q=28, method="inverse"),
    "narrow range": unit_of(sensor=COARSE, codes=(-1_000_000, 7_654_321)),
}


def compensation_for(unit: UnitDescription, per_g: np.ndarray = Q) -> Compensation:
    thermal = polynomial_model(TABLE_T0, TABLE_SLOPES, [1e-2 * s for s in TABLE_SLOPES])
    voltage_max_v = max(abs(unit.adc.code_min), abs(unit.adc.code_max)) * unit.adc.volts_per_code
    terms = Terms(per_g)
    return compensate(thermal, unit.method, (-40.0, 70.0), voltage_max_v, 1e-6, terms=terms)


PLANS = {name: make_plan(compensation_for(unit), unit) for name, unit in UNITS.items()}


# ---- the plan ----


@pytest.mark.parametrize("name", UNITS)
def test_the_integers_compute_the_float_model(name: str) -> None:
    unit, plan = UNITS[name], PLANS[name]
    compensation = compensation_for(unit)
    rng = np.random.default_rng(7)
    codes = rng.integers(plan.temp_min_code, plan.temp_max_code, 200, endpoint=True)
    raw = rng.integers(unit.adc.code_min, unit.adc.code_max, (200, 3), endpoint=True)
    state, _ = set_temperature(plan, codes)
    accel, status = apply(plan, state, raw)
    temp = codes * unit.temperature_sensor.degc_per_code
    expected = compensation.evaluate(raw * unit.adc.volts_per_code, temp)
    error_lsb = np.abs(accel - expected * 2.0**unit.output_q)[status == 0]
    assert len(error_lsb) > 100
    # 2^31 LSB in doubles of 53 bits, through some ten operations.
    assert error_lsb.max() <= prove(plan).lsb + 2.0**-18


def test_words_are_nearest_and_a_row_that_is_no_small_nonlinearity_is_refused() -> None:
    plan = PLANS["24 bits"]
    lsb = 2.0 ** -(64 - plan.shape.output_q - (plan.shape.output_shift - 32))
    assert plan.quadratic is not None
    assert np.abs(plan.quadratic * lsb - Q).max() <= lsb / 2
    limit = (2**31 - 1) * lsb
    with pytest.raises(RefusedError) as refusal:
        make_plan(
            compensation_for(UNITS["24 bits"], np.diag([0, 0, limit], 3)[:3] * 1.01),
            UNITS["24 bits"],
        )
    assert str(refusal.value) == (
        "unit TEST: quadratic terms of axis z sum to 0.01578 g/g^2; expected at most 0.01562 for "
        "the declared raw range; check the fit, or declare a narrower adc.code_min to adc.code_max"
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_term_that_is_no_number_is_refused(value: float) -> None:
    per_g = Q.copy()
    per_g[1, 2] = value
    with pytest.raises(RefusedError, match="a quadratic term is not a finite number"):
        make_plan(compensation_for(UNITS["24 bits"], per_g), UNITS["24 bits"])


# ---- the bound ----


@pytest.mark.parametrize("name", PLANS)
def test_bound_is_step_e_rounded_up(name: str) -> None:
    plan = PLANS[name]
    bound = prove(plan)
    extra = oracle.quadratic_extra(plan)
    assert all(e > 0 for e in extra)
    for axis in range(3):
        linear = max(oracle.error_bound(plan, code)[axis] for code in plan.temp_codes.tolist())
        exact = linear + extra[axis]
        assert exact <= Fraction(bound.per_axis_lsb[axis]) <= exact * (1 + Fraction(1, 2**50))


@pytest.mark.parametrize("name", PLANS)
def test_no_sample_exceeds_the_bound_and_corners_come_near(name: str) -> None:
    plan = PLANS[name]
    bound = [Fraction(lsb) for lsb in prove(plan).per_axis_lsb]
    rng = Random(name)
    low, high = plan.shape.raw_min, plan.shape.raw_max
    corners = [list(corner) for corner in itertools.product((low, high), repeat=3)]
    largest = Fraction(0)
    compared = 0
    for code in plan.temp_codes.tolist():
        rows, status = oracle.set_temperature(plan, code)
        assert status == 0
        real = oracle.real_gain_and_offset(plan, code)
        for raw in [*corners, *([rng.randint(low, high) for _ in range(3)] for _ in range(8))]:
            found, status = oracle.apply(plan, rows, raw)
            exact = oracle.real_accel(plan, real, raw)
            if status == 0:
                errors = [abs(f - e) for f, e in zip(found, exact, strict=True)]
                assert all(e <= b for e, b in zip(errors, bound, strict=True)), (code, raw)
                largest = max(largest, *(e / b for e, b in zip(errors, bound, strict=True)))
                compared += 1
    assert compared > 300
    # Saturating plans have no unsaturated corner, and the narrow range none at its larger end.
    assert largest > (0.8 if name in {"24 bits", "inverse"} else 0.4)


def test_a_word_one_off_raises_the_bound() -> None:
    # As real values the words' own: one off is then an error of one, whatever its sign.
    plan = with_quadratic(integer_plan(integer_shape(quadratic=True), [[[2**28, 0]] * 12], (0, 3)),
                          [[1000] * 6] * 3)  # fmt: skip
    good = prove(plan).per_axis_lsb
    for row, k, step in itertools.product(range(3), range(6), (-1, 1)):
        assert plan.quadratic is not None
        words = plan.quadratic.copy()
        words[row, k] += step
        bad = prove(replace(plan, quadratic=words)).per_axis_lsb
        assert bad[row] > good[row]


def test_words_beyond_step_r_are_a_fault_of_the_planner() -> None:
    plan = with_quadratic(PLANS["24 bits"], [[2**29] * 4 + [0, 0]] * 3)
    with pytest.raises(RefusedError, match="the quadratic terms of axis x could overflow"):
        prove(plan)


def test_no_quadratic_terms_change_nothing_but_their_room() -> None:
    """A plan with Q = 0 gives what the linear plan gives, at the same spare bits."""
    unit = UNITS["24 bits"]
    linear = make_plan(replace(compensation_for(unit), terms=Terms()), unit)
    nought = make_plan(compensation_for(unit, np.zeros((3, 6))), unit)
    assert nought.shape.output_shift == linear.shape.output_shift
    rng = np.random.default_rng(3)
    codes = rng.integers(-16, 28, 500)
    raw = rng.integers(-(2**23), 2**23, (500, 3))
    for plan in (linear, nought):
        assert plan.shape.quadratic == (plan is nought)
    answers = [apply(p, set_temperature(p, codes)[0], raw)[0] for p in (linear, nought)]
    assert np.array_equal(*answers)


# ---- the C ----


@pytest.mark.parametrize("method", ["matrix", pytest.param("inverse", marks=pytest.mark.slow)])
def test_three_implementations_agree_on_a_planned_unit(
    reference: Reference, tmp_path: Path, method: str
) -> None:
    unit = unit_of(sensor=SENSOR, method=method)
    plan = make_plan(compensation_for(unit), unit)
    write_generated(plan, tmp_path)
    generated = Generated(start_generated(tmp_path, tmp_path).load())
    image = image_bytes(plan)
    check = cross_check(plan, vector_sets(plan, 20_000), generated, reference.routine(image), image)
    bound = prove(plan)
    assert bound.lsb <= 1.0
    assert 0.8 * bound.lsb <= check.largest_error_lsb <= bound.lsb
    assert check_images(plan, image_cases(plan, image), generated, reference) > 300
