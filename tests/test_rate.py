"""The term in dT/dt from floats to C: plan, proven bound, cross-check, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import oracle
from builds import PROVENANCE, write_generated
from plans import SENSOR, TABLE_SLOPES, TABLE_T0, polynomial_model, unit_of
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import render_constants
from triaxcal.codegen.crosscheck import cross_check, vector_sets
from triaxcal.codegen.forces import rates_of
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import check_images, image_cases
from triaxcal.codegen.routines import Reference, routines_of, start_generated
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.terms import EXAMPLE_RATE, EXAMPLE_TERMS, RateTerm, Terms
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermometer import TemperatureSensor

COARSE = TemperatureSensor(degc_per_code=2.5, degc_at_zero=0.0)
TERM = EXAMPLE_RATE
UNITS = {
    "24 bits": unit_of(sensor=COARSE),
    "inverse": unit_of(sensor=COARSE, method="inverse"),
    "32 bits saturating": unit_of(sensor=COARSE, bits=32, output_q=28),
    "inverse saturating": unit_of(sensor=COARSE, bits=32, output_q=28, method="inverse"),
}


def compensation_for(unit: UnitDescription, terms: Terms) -> Compensation:
    thermal = polynomial_model(TABLE_T0, TABLE_SLOPES, [1e-2 * s for s in TABLE_SLOPES])
    voltage_max_v = max(abs(unit.adc.code_min), abs(unit.adc.code_max)) * unit.adc.volts_per_code
    return compensate(thermal, unit.method, (-40.0, 70.0), voltage_max_v, 1e-6, terms=terms)


def planned(unit: UnitDescription, terms: Terms | None = None) -> Plan:
    return make_plan(compensation_for(unit, terms or Terms(rate=TERM)), unit)


PLANS = {name: planned(unit) for name, unit in UNITS.items()}
PLANS["with quadratic terms"] = planned(UNITS["24 bits"], replace(EXAMPLE_TERMS, rate=TERM))


@pytest.mark.parametrize("name", PLANS)
def test_the_integers_compute_the_float_model(name: str) -> None:
    unit, plan = UNITS.get(name, UNITS["24 bits"]), PLANS[name]
    terms = replace(EXAMPLE_TERMS, rate=TERM) if name not in UNITS else Terms(rate=TERM)
    compensation = compensation_for(unit, terms)
    rng = np.random.default_rng(9)
    codes = rng.integers(plan.temp_min_code, plan.temp_max_code, 300, endpoint=True)
    raw = rng.integers(unit.adc.code_min, unit.adc.code_max, (300, 3), endpoint=True)
    assert plan.rate is not None
    rates = rng.integers(3 * plan.rate.min_code, 3 * plan.rate.max_code, 300)
    state, rate_status = set_temperature(plan, codes, rates)
    accel, status = apply(plan, state, raw)
    step = COARSE.degc_per_code * 2.0**-16
    # Rounded inwards to a code: the model is asked about the range's ends as codes say them.
    clamped = rates.clip(plan.rate.min_code, plan.rate.max_code) * step
    temp = codes * COARSE.degc_per_code
    expected = compensation.evaluate(raw * unit.adc.volts_per_code, temp, clamped)
    error_lsb = np.abs(accel - expected * 2.0**unit.output_q)[status == 0]
    assert len(error_lsb) > 100
    assert error_lsb.max() <= prove(plan).lsb + 2.0**-18  # doubles of 53 bits
    assert ((rate_status != 0) == (clamped != rates * step)).all()
    assert 50 < (rate_status == oracle.RATE_RANGE).sum() < 250
    at_rest = set_temperature(plan, codes)[0]
    assert np.array_equal(at_rest.offset, set_temperature(plan, codes, 0 * rates)[0].offset)


@pytest.mark.parametrize("name", PLANS)
def test_the_model_is_the_page_and_its_error_within_the_bound(name: str) -> None:
    plan = PLANS[name]
    assert plan.rate is not None
    bound = [Fraction(lsb) for lsb in prove(plan).per_axis_lsb]
    still = prove(replace(plan, rate=None)).per_axis_lsb
    assert all(b > s for b, s in zip(bound, still, strict=True))
    codes = plan.temp_codes
    rates = rates_of(plan.rate, codes)
    low, high = plan.shape.raw_min, plan.shape.raw_max
    rng = np.random.default_rng(4)
    compared = 0
    for code, rate in zip(codes.tolist(), rates.tolist(), strict=True):
        raw = [int(rng.choice([low, high, low // 2, high // 3])) for _ in range(3)]
        rows, status = oracle.set_temperature(plan, code, rate)
        found, sample = oracle.apply(plan, rows, raw)
        one = np.array([code]), np.array([rate])
        state, model_status = set_temperature(plan, *one)
        accel, model_sample = apply(plan, state, np.array([raw]))
        assert (accel[0].tolist(), int(model_status[0]), int(model_sample[0])) == (
            found, status, sample,
        )  # fmt: skip
        clamped = min(max(rate, plan.rate.min_code), plan.rate.max_code)
        real = oracle.real_gain_and_offset(plan, code)
        for row, r in zip(real, plan.rate.real.tolist(), strict=True):
            row[3] += Fraction(r) * clamped * plan.rate.gain / 2**32
        exact = oracle.real_accel(plan, real, raw)
        if sample == 0:
            errors = [abs(f - e) for f, e in zip(found, exact, strict=True)]
            assert all(e <= b for e, b in zip(errors, bound, strict=True)), (code, raw, rate)
            compared += 1
    assert compared > 15


def test_rates_hold_none_ends_and_what_lies_between() -> None:
    rate = PLANS["24 bits"].rate
    assert rate is not None
    found = rates_of(rate, np.arange(4000))
    assert set(found.tolist()) >= {-(2**31), 2**31 - 1, 0, rate.min_code, rate.max_code + 1}
    inside = (found > rate.min_code) & (found < rate.max_code) & (found != 0)
    assert inside.sum() > 1500


@pytest.mark.parametrize(
    ("term", "text"),
    [
        (
            RateTerm(np.ones(3), (-1e-9, 1e-9)),
            (
                "unit TEST: rates of -1e-09 to 1e-09 K/s are codes of 0 to 0; expected codes other "
                "than 0, within 2147483647, each of 3.81e-05 K/s; check "
                "temperature_sensor.degc_per_code and the unit of the rates"
            ),
        ),
        (
            RateTerm(np.array([0.0, 0.0, 900.0]), (-0.1, 0.1)),
            "unit TEST: an offset of 90 g by dT/dt at the ends of its range; expected less than",
        ),
    ],
)
def test_terms_that_do_not_fit_are_refused(term: RateTerm, text: str) -> None:
    with pytest.raises(RefusedError) as refusal:
        planned(UNITS["24 bits"], Terms(rate=term))
    assert str(refusal.value).startswith(text)


# ---- the C ----


@pytest.mark.parametrize(
    ("method", "output_q", "terms"),
    [
        ("matrix", 24, replace(EXAMPLE_TERMS, rate=TERM)),
        pytest.param("inverse", 28, Terms(rate=TERM), marks=pytest.mark.slow),
        pytest.param("matrix", 28, Terms(rate=TERM), marks=pytest.mark.slow),
        pytest.param("inverse", 24, replace(EXAMPLE_TERMS, rate=TERM), marks=pytest.mark.slow),
    ],
)
def test_three_implementations_agree(
    reference: Reference, tmp_path: Path, method: str, output_q: int, terms: Terms
) -> None:
    unit = unit_of(sensor=SENSOR, method=method, output_q=output_q)
    plan = planned(unit, terms)
    write_generated(plan, tmp_path)
    library = start_generated(tmp_path, tmp_path).load()
    generated, handwritten = routines_of(plan.rate, library, reference.library)
    image = image_bytes(plan)
    sets = vector_sets(plan, 20_000)
    check = cross_check(plan, sets, generated, handwritten.routine(image), image)
    bound = prove(plan)
    assert 0.8 * bound.lsb <= check.largest_error_lsb <= bound.lsb
    assert check_images(plan, image_cases(plan, image), generated, handwritten) > 300
    text = render_constants(plan, SENSOR, PROVENANCE)["triax_calib.c"]
    assert "/* rate_max_code: 0.0799999 K/s */" in text  # the last code within 0.08 K/s
    assert "/* rx: 0.021 g for 1 K/s, rounding " in text
