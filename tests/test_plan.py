"""The plan: codes, segments, formats and rounding, against what fixed-point.md says."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from plans import (
    INT32_MAX,
    INT32_MIN,
    ROW_LIMIT,
    TABLE_SLOPES,
    TABLE_T0,
    polynomial_model,
    raw_shift_of,
    unit_of,
)
from triaxcal.fixedpoint.device_units import MAX_TEMPERATURE_CODES
from triaxcal.fixedpoint.formats import MAX_SPARE_BITS
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.method import DIRECT, INVERSE
from triaxcal.model.methods.registry import METHODS
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermometer import TemperatureSensor

SQUARES = [1e-2 * slope for slope in TABLE_SLOPES]
EPS = np.finfo(np.float64).eps


def quadratic(range_degc: tuple[float, float] = (-40.0, 70.0)) -> ThermalModel:
    return polynomial_model(TABLE_T0, TABLE_SLOPES, SQUARES, range_degc=range_degc)


def cut(breaks: tuple[float, ...]) -> ThermalModel:
    """The same quadratic functions, cut into segments."""
    rows = np.repeat(quadratic().curves.coefficients, len(breaks) - 1, axis=0)
    origins = (20.0,) * (len(breaks) - 1)
    return ThermalModel(20.0, PiecewisePolynomial(breaks, origins, rows))


def planned(
    unit: UnitDescription,
    thermal: ThermalModel | None = None,
    range_degc: tuple[float, float] = (-40.0, 70.0),
) -> tuple[Compensation, Plan]:
    adc = unit.adc
    voltage_max_v = max(abs(adc.code_min), abs(adc.code_max)) * adc.volts_per_code
    compensation = compensate(thermal or quadratic(), unit.method, range_degc, voltage_max_v, 1e-6)
    return compensation, make_plan(compensation, unit)


# ---- raw codes ----


@st.composite
def adcs(draw: st.DrawFn) -> tuple[int, tuple[int, int]]:
    bits = draw(st.integers(8, 32))
    half = 2 ** (bits - 1)
    code = st.one_of(
        st.integers(-half, half - 1),
        st.sampled_from([-half, -half + 1, -1, 0, 1, half - 2, half - 1]),
        st.integers(0, bits - 2).map(lambda n: 2**n),
        st.integers(0, bits - 2).map(lambda n: -(2**n)),
    )
    low, high = draw(code), draw(code)
    if low == high:
        low, high = (low - 1, high) if low > -half else (low, high + 1)
    return bits, (min(low, high), max(low, high))


@settings(max_examples=80)
@given(adc=adcs())
def test_raw_shift_is_the_largest_that_fits(adc: tuple[int, tuple[int, int]]) -> None:
    bits, codes = adc
    sensor = TemperatureSensor(10.0, 0.0)
    _, plan = planned(unit_of(bits=bits, codes=codes, sensor=sensor, method="additive"))
    shape = plan.shape
    assert (shape.raw_min, shape.raw_max) == codes
    assert shape.raw_shift == raw_shift_of(codes)
    ends = [code * 2**shape.raw_shift for code in codes]
    assert all(INT32_MIN <= end <= INT32_MAX for end in ends)
    assert shape.raw_box == max(abs(end) for end in ends)


# ---- temperature codes and segments ----


@settings(max_examples=80)
@given(
    low=st.floats(-40.0, 60.0),
    width=st.floats(0.1, 10.0),
    per_code=st.sampled_from([0.0078125, 0.0625, 0.1, 0.005, 1 / 3]),
    at_zero=st.sampled_from([0.0, -273.15, 25.0, 0.0317]),
)
def test_codes_are_those_within_the_range(
    low: float, width: float, per_code: float, at_zero: float
) -> None:
    sensor = TemperatureSensor(per_code, at_zero)
    high = min(low + width, 70.0)
    inside = [
        code
        for code in range(sensor.code(low) - 2, sensor.code(high) + 3)
        # A millionth of a code is not a code beyond the end.
        if low - 1e-6 * per_code <= sensor.degc(code) <= high + 1e-6 * per_code
    ]
    if not inside:
        return
    _, plan = planned(unit_of(sensor=sensor, method="additive"), range_degc=(low, high))
    assert plan.temp_codes.tolist() == inside


@pytest.mark.parametrize(
    "breaks",
    [
        (-40.0, 70.0),
        (-40.0, 20.0, 70.0),
        (-40.0, -39.99, 20.0, 70.0),
        (-40.0, -20.003, -3.1, 20.0, 41.7, 69.995, 70.0),
        (-40.0, 20.001, 20.003, 20.005, 70.0),  # two segments without a code
    ],
)
@pytest.mark.parametrize("method", ["additive", "inverse"])
def test_segments_cover_the_range_and_x_fills_q31(breaks: tuple[float, ...], method: str) -> None:
    unit = unit_of(method=method, sensor=TemperatureSensor(0.0625, 0.0))
    compensation, plan = planned(unit, cut(breaks))
    firsts = [s.first_code for s in plan.segments]
    assert firsts[0] == plan.temp_min_code
    assert firsts == sorted(set(firsts))
    lasts = [f - 1 for f in firsts[1:]] + [plan.temp_max_code]
    for segment, first, last in zip(plan.segments, firsts, lasts, strict=True):
        # The same functions everywhere here, so which segment a code is in shows in degC alone.
        degc = [unit.temperature_sensor.degc(code) for code in (first, last)]
        assert len({int(compensation.curves.segment_index(np.array(t))) for t in degc}) == 1
        assert segment.origin_code in ((first + last) // 2, (first + last + 1) // 2)
        reach = max(last - segment.origin_code, segment.origin_code - first)
        assert segment.gain & (segment.gain - 1) == 0
        assert reach * segment.gain <= INT32_MAX
        assert 2 * reach * segment.gain > INT32_MAX or segment.gain >= 2**30
    prove(plan)


def test_a_break_on_a_code_belongs_to_the_segment_above() -> None:
    _, plan = planned(unit_of(method="additive"), cut((-40.0, 0.0, 20.0, 70.0)))
    assert [s.first_code for s in plan.segments] == [-5120, 0, 2560]
    _, plan = planned(unit_of(method="additive"), cut((-40.0, 0.001, 19.999, 70.0)))
    assert [s.first_code for s in plan.segments] == [-5120, 1, 2560]


def test_a_range_of_one_code_is_planned() -> None:
    for method in METHODS.names:
        _, plan = planned(
            unit_of(method=method, sensor=TemperatureSensor(1.0, 0.0)), range_degc=(19.5, 20.4)
        )
        assert plan.temp_codes.tolist() == [20]
        assert prove(plan).codes == 1


def test_the_most_temperature_codes_are_taken() -> None:
    sensor = TemperatureSensor(100.0 / (MAX_TEMPERATURE_CODES - 1), 0.0)
    unit = unit_of(method="additive", sensor=sensor)
    _, plan = planned(unit, range_degc=(-40.0, 60.0))
    assert abs(len(plan.temp_codes) - MAX_TEMPERATURE_CODES) <= 1


# ---- what the integers stand for ----


@pytest.mark.parametrize("method", METHODS.names)
@pytest.mark.parametrize(
    "unit",
    [
        unit_of(),
        unit_of(bits=32, full_scale_v=20.0),
        unit_of(codes=(-5_000_000, 8_000_000), output_q=20),
        unit_of(bits=16, output_q=28, sensor=TemperatureSensor(0.1, -273.15)),
    ],
    ids=["24 bits", "32 bits saturating", "narrow", "16 bits"],
)
def test_real_functions_are_the_compensation_in_their_units(
    method: str, unit: UnitDescription
) -> None:
    unit = replace(unit, method=method)
    compensation, plan = planned(unit, cut((-40.0, 3.3, 20.0, 70.0)))
    shape = plan.shape
    temps = np.array([unit.temperature_sensor.degc(code) for code in plan.temp_codes.tolist()])
    N, b = compensation.gain_and_offset(temps)
    rows = plan.real_rows()
    # Gains in 2^-(Q + output_shift) g per left-justified code, offsets in 2^-(Q + shift - 32) g.
    place_g = 2.0 ** -(shape.output_q + shape.output_shift)
    code_v = unit.adc.volts_per_code / 2.0**shape.raw_shift
    assert plan.volts_per_lsb == code_v
    # A polynomial moved to another origin, some hundred roundings of its largest value.
    assert np.abs(rows[:, :, :3] * place_g / code_v - N).max() <= 500 * EPS * np.abs(N).max()
    assert np.abs(rows[:, :, 3] * place_g * 2.0**32 - b).max() <= 500 * EPS * max(
        1.0, float(np.abs(b).max())
    )


@pytest.mark.parametrize("method", METHODS.names)
@pytest.mark.parametrize(("bits", "output_q"), [(24, 24), (32, 29), (12, 10)])
def test_integers_are_rounded_half_up_with_half_for_each_floor(
    method: str, bits: int, output_q: int
) -> None:
    _, plan = planned(unit_of(bits=bits, output_q=output_q, method=method))
    shape = plan.shape
    spare = shape.output_shift - 32
    for s, segment in enumerate(plan.segments):
        for f in range(12):
            for k in range(shape.order + 1):
                exact = Fraction(float(plan.real[s, f, k])) * 2**k
                if k < shape.order:
                    exact += Fraction(1, 2)
                if k == 0 and f % 4 == 3 and spare >= 1 and shape.form == DIRECT:
                    exact += 2 ** (spare - 1)
                distance = int(segment.coefficients[f, k]) - exact
                # Half up; the sum of a float below 2^31 and 1/2 is rounded to 2^-22 at most.
                slack = Fraction(1, 2**21)
                assert Fraction(-1, 2) - slack < distance <= Fraction(1, 2) + slack


# ---- formats ----


def direct_fits(plan: Plan, more: int) -> bool:
    """Whether `more` spare bits than planned would leave step R's room, by real bounds."""
    terms = plan.shape.order + 1
    spare = plan.shape.output_shift - 32 + more
    for s in range(plan.shape.segments):
        bounds = []
        for f in range(12):
            scaled = [abs(Fraction(float(c))) * Fraction(2) ** more for c in plan.real[s, f]]
            stages = [sum(scaled[k:]) * 2**k + terms + 2 for k in range(terms)]
            if max(stages) > INT32_MAX:
                return False
            bounds.append(stages[0])
        for i in (0, 4, 8):
            preload = Fraction(2) ** (spare + 1)
            if sum(bounds[i : i + 3]) + 2 * bounds[i + 3] + preload >= ROW_LIMIT:
                return False
    return True


@pytest.mark.parametrize("output_q", [8, 16, 24, 27, 30])
@pytest.mark.parametrize("full_scale_v", [0.5, 2.5, 7.0])
@pytest.mark.parametrize("method", ["matrix", "additive"])
def test_spare_bits_are_as_many_as_fit(method: str, full_scale_v: float, output_q: int) -> None:
    unit = unit_of(bits=32, full_scale_v=full_scale_v, output_q=output_q, method=method)
    _, plan = planned(unit)
    spare = plan.shape.output_shift - 32
    assert -4 <= spare <= MAX_SPARE_BITS
    assert direct_fits(plan, 0)
    assert spare == MAX_SPARE_BITS or not direct_fits(plan, 1)
    assert oracle.keeps_step_r(plan)
    assert plan.shape.saturates == (spare <= 0)


@settings(max_examples=40)
@given(
    full_scale_v=st.floats(0.5, 50.0),
    output_q=st.integers(8, 26),
    sign=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3),
)
def test_no_word_of_the_inversion_saturates_and_each_is_full(
    full_scale_v: float, output_q: int, sign: tuple[float, float, float]
) -> None:
    flip = np.array([*np.repeat(sign, 3), *sign])  # outputs of reversed polarity
    thermal = polynomial_model(*(flip * np.array(p) for p in (TABLE_T0, TABLE_SLOPES, SQUARES)))
    unit = unit_of(
        bits=32, full_scale_v=full_scale_v, output_q=output_q, method="inverse",
        sensor=TemperatureSensor(5.0, 0.0),
    )  # fmt: skip
    _, plan = planned(unit, thermal)
    shifts = plan.shape.inverse
    assert plan.shape.form == INVERSE
    assert shifts is not None
    largest = {"k": 0, "adjugate": 0, "determinant": 0, "reciprocal": 0}
    for code in plan.temp_codes.tolist():
        values = oracle.functions(plan, code)
        k = [values[4 * i : 4 * i + 3] for i in range(3)]
        cofactors = [
            oracle.floor_of(oracle.cofactor(k, i, j), shifts.adjugate_shift)
            for i in range(3)
            for j in range(3)
        ]
        adj_column = [
            oracle.floor_of(oracle.cofactor(k, 0, j), shifts.adjugate_shift) for j in range(3)
        ]
        quarter = sum(oracle.floor_of(k[0][j] * adj_column[j], 2) for j in range(3))
        det = oracle.floor_of(quarter, shifts.determinant_shift)
        assert abs(det) > 2 ** (shifts.reciprocal_log2 - 31)
        for name, value in (
            ("k", max(abs(v) for row in k for v in row)),
            ("adjugate", max(map(abs, cofactors))),
            ("determinant", abs(det)),
            ("reciprocal", 2**shifts.reciprocal_log2 // abs(det)),
        ):
            largest[name] = max(largest[name], value)
        rows, status = oracle.set_temperature(plan, code)
        assert status == 0
        assert all(INT32_MIN < n < INT32_MAX for row in rows for n in row)
    assert all(value <= INT32_MAX for value in largest.values())
    # Full: 30 of 31 bits. The adjugate and determinant are full by their own shifts; K has no more
    # than a factor 2 to its power of two; the reciprocal halves when one more bit does not fit.
    assert all(value >= 2**29 for value in largest.values()), largest


@pytest.mark.parametrize("method", METHODS.names)
def test_more_bits_of_output_never_make_the_answer_worse_in_g(method: str) -> None:
    errors = []
    for output_q in (12, 16, 20, 24):
        unit = unit_of(output_q=output_q, method=method, sensor=TemperatureSensor(2.5, 0.0))
        errors.append(prove(planned(unit)[1]).lsb * 2.0**-output_q)
    assert errors == sorted(errors, reverse=True)
