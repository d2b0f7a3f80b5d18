"""What the planner refuses, whom it blames, and whether its remedy works."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from plans import (
    INT32_MAX,
    TABLE_SLOPES,
    TABLE_T0,
    polynomial_model,
    unit_of,
)
from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.method import DIRECT
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermometer import TemperatureSensor

COARSE = TemperatureSensor(degc_per_code=2.5, degc_at_zero=0.0)
"""45 codes from -40 to 70 degC: few enough for fractions."""


def planned(unit: UnitDescription, thermal: ThermalModel) -> Plan:
    adc = unit.adc
    voltage_max_v = max(abs(adc.code_min), abs(adc.code_max)) * adc.volts_per_code
    return make_plan(compensate(thermal, unit.method, (-40.0, 70.0), voltage_max_v, 1e-6), unit)


@pytest.mark.parametrize("method", METHODS.names)
@pytest.mark.parametrize(("full_scale_v", "bits"), [(20.0, 32), (100.0, 24)])
def test_a_raw_range_too_wide_for_the_output_names_the_highest_q_that_works(
    method: str, full_scale_v: float, bits: int
) -> None:
    unit = unit_of(sensor=COARSE, bits=bits, full_scale_v=full_scale_v, output_q=30, method=method)
    thermal = polynomial_model(TABLE_T0, TABLE_SLOPES)
    with pytest.raises(RefusedError) as refusal:
        planned(unit, thermal)
    text = str(refusal.value)
    range_g = full_scale_v / 0.54  # K_ii is 0.55 V/g, and cross terms add to the row
    stated = re.search(r"the declared raw range stands for ([\d.]+) g", text)
    assert stated is not None, text
    assert range_g < float(stated[1]) < 1.1 * range_g
    assert "does not fit int32 at compensation.output_q = 30" in text
    suggested = re.search(r"set compensation.output_q = (\d+) or lower", text)
    assert suggested is not None, text
    highest = int(suggested[1])
    assert prove(planned(replace(unit, output_q=highest), thermal)).lsb > 0.5
    with pytest.raises(RefusedError):
        planned(replace(unit, output_q=highest + 1), thermal)


def test_the_other_remedy_a_narrower_range_works_too() -> None:
    unit = unit_of(sensor=COARSE, bits=24, full_scale_v=100.0, output_q=30)
    thermal = polynomial_model(TABLE_T0, TABLE_SLOPES)
    with pytest.raises(RefusedError, match=r"or declare a narrower adc.code_min to adc.code_max"):
        planned(unit, thermal)
    narrow = unit_of(
        sensor=COARSE, bits=24, full_scale_v=100.0, output_q=30, codes=(-(2**18), 2**18 - 1)
    )
    assert prove(planned(narrow, thermal)).lsb > 0.5


def test_no_output_q_is_suggested_that_unit_toml_would_refuse() -> None:
    insensitive = polynomial_model([1e-6 * c for c in TABLE_T0])
    unit = unit_of(sensor=COARSE, full_scale_v=100.0, output_q=12)
    for method in ("matrix", "inverse"):
        with pytest.raises(RefusedError) as refusal:
            planned(replace(unit, method=method), insensitive)
        assert "set compensation.output_q" not in str(refusal.value)
        assert "declare a narrower adc.code_min to adc.code_max" in str(refusal.value)


def steep(order: int, place: int, value: float) -> FloatArray:
    coefficients = np.zeros((1, 12, order + 1))
    coefficients[0, :9, 0] = np.diag([-1.8] * 3).ravel()
    coefficients[0, place, order] = value
    return coefficients


def test_a_coefficient_too_steep_is_named_and_the_suggested_q_works() -> None:
    # Nxy (place 1) grows as the fifth power: in x it is 2^5 times as large as at the range's end.
    curves = PiecewisePolynomial((-40.0, 70.0), (15.0,), steep(5, 1, 100.0 / 55.0**5))
    compensation = Compensation("matrix", DIRECT, curves)
    unit = unit_of(sensor=COARSE)
    with pytest.raises(RefusedError) as refusal:
        make_plan(compensation, unit)
    text = str(refusal.value)
    assert "the temperature coefficient of order 5 of Nxy is too steep for the range" in text
    highest = int(re.findall(r"output_q = (\d+)", text)[1])
    prove(make_plan(compensation, replace(unit, output_q=highest)))
    with pytest.raises(RefusedError):
        make_plan(compensation, replace(unit, output_q=highest + 1))


def test_a_steep_matrix_of_the_inverse_form_is_planned_with_fewer_bits() -> None:
    fourth = [0.0] * 12
    fourth[1] = 1e-8
    thermal = polynomial_model(TABLE_T0, [0.0] * 12, [0.0] * 12, [0.0] * 12, fourth)
    plan = planned(unit_of(sensor=COARSE, method="inverse"), thermal)
    prove(plan)  # refused as "a fault in triaxcal" once
    assert abs(int(plan.segments[0].coefficients[1, 4])) > INT32_MAX // 4


def test_a_steep_bias_of_the_inverse_form_is_named() -> None:
    slopes = [0.0] * 12
    slopes[10] = 0.04
    thermal = polynomial_model(TABLE_T0, slopes)
    unit = unit_of(sensor=COARSE, method="inverse")
    with pytest.raises(RefusedError, match="coefficient of order 1 of U0y is too steep"):
        planned(unit, thermal)
    planned(replace(unit, method="matrix"), thermal)  # the remedy


def test_a_bias_beyond_the_raw_range_is_named() -> None:
    constants = list(TABLE_T0)
    constants[11] = 2.6
    with pytest.raises(RefusedError, match="U0z lies beyond the declared raw range"):
        planned(unit_of(sensor=COARSE, method="inverse"), polynomial_model(constants))


def test_a_range_without_a_temperature_code_is_refused() -> None:
    unit = unit_of(sensor=TemperatureSensor(10.0, 0.0))
    comp = compensate(polynomial_model(TABLE_T0), "inverse", (21.0, 29.0), 2.5, 1e-6)
    with pytest.raises(RefusedError, match="no temperature code lies in 21 to 29 degC"):
        make_plan(comp, unit)


def test_too_many_temperature_codes_are_refused() -> None:
    unit = unit_of(sensor=TemperatureSensor(1e-4, 0.0))
    with pytest.raises(RefusedError, match=r"degc_per_code = 0.0001 makes 1100001 codes"):
        planned(unit, polynomial_model(TABLE_T0, TABLE_SLOPES))
    far = unit_of(sensor=TemperatureSensor(1e-6, -2000.0))
    comp = compensate(polynomial_model(TABLE_T0, TABLE_SLOPES), "matrix", (20.0, 20.1), 2.5, 1e-6)
    with pytest.raises(RefusedError, match="do not fit int32 with a bit to spare"):
        make_plan(comp, far)
