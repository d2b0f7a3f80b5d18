"""Thermal curves: P1 (11) by Cramer in fractions, P1 (12) and Table 3, hats, refusals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fit_cases import SEVEN, TABLE_TEMPS, TABLES, TABLES_PRINTED, cubic_truth
from triaxcal.base.errors import RefusedError
from triaxcal.model.curves import relative_coefficients
from triaxcal.model.metrological import BIASES, CONSTANT_NAMES
from triaxcal.model.thermal.piecewise_linear import PiecewiseLinearShape
from triaxcal.model.thermal.polynomial import PolynomialShape
from triaxcal.model.thermal.shape import ThermalShape

EPS = np.finfo(float).eps

# P1, Table 3: the segment -40..+20 (misprinted "40"), the segment +20..+70.
TABLE_3 = {
    "Kxx": ("-0.00000406", "0.00002884"),
    "Kyy": ("0.00001951", "0.00002850"),
    "Kzz": ("0.00000821", "0.00004391"),
    "U0x": ("-0.00012202", "-0.00001786"),
    "U0y": ("-0.00008331", "-0.00004026"),
    "U0z": ("-0.00006473", "0.00002467"),
    "Kxy": ("0.00412678", "-0.00344515"),
    "Kxz": ("0.00037706", "0.00016603"),
    "Kyx": ("0.00057535", "0.00062950"),
    "Kyz": ("-0.00189274", "0.00046547"),
    "Kzx": ("0.00038558", "0.00016187"),
    "Kzy": ("0.00577492", "-0.00466918"),
}
LAST_DIGIT = 5e-9
"""Half of the last digit printed in all three tables."""


def interpolated(shape: ThermalShape, temps, values):
    """Model through points: values (G, 12) at temps (G,), G = P."""
    parameters = np.linalg.solve(shape.basis(np.asarray(temps)), values)
    return shape.model(parameters.T)


def determinant(rows: list[list[Fraction]]) -> Fraction:
    if len(rows) == 1:
        return rows[0][0]
    return sum(
        ((-1) ** j * rows[0][j] * determinant([r[:j] + r[j + 1 :] for r in rows[1:]]))
        for j in range(len(rows))
    )


def cramer(deltas: list[Fraction], values: list[Fraction]) -> list[Fraction]:
    """P1 (11): coefficients of dT, dT^2, ... for values minus that at T0."""
    matrix = [[d ** (n + 1) for n in range(len(deltas))] for d in deltas]
    whole = determinant(matrix)
    return [
        determinant([[*row[:n], v, *row[n + 1 :]] for row, v in zip(matrix, values, strict=True)])
        / whole
        for n in range(len(deltas))
    ]


def test_order_3_is_cramers_rule_of_equation_11():
    temps = [-40, -10, 20, 70]
    # Decimal numbers, so that fractions hold them exactly.
    values = [[Fraction(f"{v:.9f}") for v in cubic_truth()(np.array(float(t)))] for t in temps]
    shape = PolynomialShape.over(np.array(temps, dtype=float), 20.0, 3)
    model = interpolated(shape, temps, np.array([[float(v) for v in row] for row in values]))
    found = relative_coefficients(model)[0]
    deltas = [Fraction(t - 20) for t in temps if t != 20]
    inverse = np.linalg.inv(np.array([[float(d) ** n for n in (1, 2, 3)] for d in deltas]))
    for c, name in enumerate(CONSTANT_NAMES):
        at_t0 = values[2][c]
        change = [row[c] - at_t0 for t, row in zip(temps, values, strict=True) if t != 20]
        divisor = 1 if c in BIASES else at_t0
        exact = [float(x / divisor) for x in cramer(deltas, change)]
        # Values are rounded to doubles, 1/2 eps each, and the solve loses a few more of them (10).
        size = max(abs(float(row[c])) for row in values) / abs(float(divisor))
        tolerance = 10 * EPS * 2 * size * np.abs(inverse).sum(axis=1)
        assert np.all(np.abs(found[c] - exact) <= tolerance), name


def table_3_model():
    shape = PiecewiseLinearShape.over(np.array(TABLE_TEMPS), 20.0, None)
    assert shape.knots_degc == TABLE_TEMPS
    return interpolated(shape, TABLE_TEMPS, TABLES)


def table_3_tolerance(name: str, segment: int) -> float:
    """What the last digits of tables 1, 2 and 3 leave open.

    With K = K0 + dK: |d(dK / K0)| <= (2 d + d |dK / K0|) / |K0|, d the rounding of an entry;
    divided by |dT|, and the rounding of Table 3 itself. To second order in d nothing is left.
    """
    before, at_t0, after = (float(v) for v in TABLES_PRINTED[name])
    change, delta = (before - at_t0, 60.0) if segment == 0 else (after - at_t0, 50.0)
    if name.startswith("U0"):
        return 2 * LAST_DIGIT / delta + LAST_DIGIT
    relative = (2 + abs(change / at_t0)) * LAST_DIGIT / abs(at_t0)
    return relative / delta + LAST_DIGIT


@pytest.mark.parametrize("segment", [0, 1])
@pytest.mark.parametrize("name", TABLE_3)
def test_table_3_from_tables_1_and_2(name, segment):
    found = relative_coefficients(table_3_model())[segment, CONSTANT_NAMES.index(name), 0]
    assert abs(found - float(TABLE_3[name][segment])) <= table_3_tolerance(name, segment)


@pytest.mark.parametrize("name", [n for n in TABLE_3 if n not in ("U0x", "U0y", "U0z")])
def test_equation_11_as_printed_lacks_the_division_by_k_cal(name):
    index = CONSTANT_NAMES.index(name)
    for segment in (0, 1):
        undivided = table_3_model().curves.coefficients[segment, index, 1]
        printed = float(TABLE_3[name][segment])
        # Without K_cal the numbers of Table 3 are missed by far more than the tables' rounding.
        assert abs(undivided - printed) > 10 * table_3_tolerance(name, segment)


def test_equation_12_by_its_own_formula():
    model = table_3_model()
    found = relative_coefficients(model)
    for segment, (temp, row) in enumerate(((-40.0, 0), (70.0, 2))):
        change = (TABLES[row] - TABLES[1]) / (temp - 20.0)
        expected = np.where(np.arange(12) >= 9, change, change / TABLES[1])
        np.testing.assert_allclose(found[segment, :, 0], expected, rtol=0, atol=1e3 * EPS)


def test_a_constant_that_is_zero_at_t0_has_no_relative_form():
    values = TABLES.copy()
    values[1, 1] = 0.0
    shape = PiecewiseLinearShape.over(np.array(TABLE_TEMPS), 20.0, None)
    found = relative_coefficients(interpolated(shape, TABLE_TEMPS, values))
    assert np.isnan(found[:, 1]).all()
    assert np.isfinite(np.delete(found, 1, axis=1)).all()


@pytest.mark.parametrize("order", range(10))
def test_polynomial_model_is_its_basis(order):
    temps = np.linspace(-40.0, 70.0, 23)
    shape = PolynomialShape.over(temps, 20.0, order)
    assert shape.parameters == order + 1
    parameters = np.random.default_rng(order).normal(size=(12, order + 1))
    model = shape.model(parameters)
    # Sums of order + 1 terms of at most |x|^n = 1 times a normal number.
    np.testing.assert_allclose(
        model.constants_at(temps), shape.basis(temps) @ parameters.T, atol=200 * EPS
    )


@pytest.mark.parametrize(
    "knots", [(-40.0, 20.0, 70.0), (-40.0, 70.0), SEVEN, (-40.0, 10.0, 30.0, 70.0)]
)
def test_piecewise_linear_model_is_its_basis(knots):
    shape = PiecewiseLinearShape.over(np.array(SEVEN), 20.0, knots)
    temps = np.linspace(-41.0, 71.0, 225)
    values = np.random.default_rng(7).normal(size=(12, len(knots)))
    model = shape.model(values)
    np.testing.assert_allclose(
        model.constants_at(temps), shape.basis(temps) @ values.T, atol=500 * EPS
    )
    # Continuous: both neighbours give the knot's value.
    for j, knot in enumerate(knots):
        np.testing.assert_allclose(model.constants_at(knot), values[:, j], atol=100 * EPS)
        below = model.constants_at(np.nextafter(knot, -np.inf))
        np.testing.assert_allclose(below, values[:, j], atol=100 * EPS)


def test_origins_are_t0_next_to_t0_and_the_lower_knot_elsewhere():
    def origins(knots):
        shape = PiecewiseLinearShape.over(np.array(SEVEN), 20.0, knots)
        return shape.model(np.zeros((12, shape.parameters))).curves.origins_degc

    assert origins(None) == (20.0, 20.0)
    assert origins(SEVEN) == (-40.0, -20.0, 20.0, 20.0, 40.0, 55.0)
    assert origins((0.0, 40.0)) == (-40.0, 20.0, 40.0)


def test_default_knots():
    def knots(temps, t0=20.0, chosen=None):
        return PiecewiseLinearShape.over(np.array(temps), t0, chosen).knots_degc

    assert knots((-39.9, 20.3, 70.1)) == (-39.9, 20.0, 70.1)
    assert knots((20.3, 70.1)) == (20.0, 70.1)  # T0 is an end
    assert knots((-39.9, 19.8)) == (-39.9, 20.0)
    assert knots(SEVEN, chosen=(10.0,)) == (-40.0, 10.0, 70.0)
    assert knots((-39.9, 20.3, 70.1), chosen=(-40.0, 20.0, 70.0)) == (-40.0, 20.0, 70.0)
    assert PiecewiseLinearShape.through(np.array((-39.9, 19.7, 70.1)), 20.0).knots_degc == (
        -39.9,
        20.0,
        70.1,
    )


@given(st.lists(st.floats(-60, 120), min_size=2, max_size=9, unique_by=lambda t: round(t / 3)))
def test_hats_sum_to_one_and_reproduce_a_line(knots):
    knots = sorted(knots)
    shape = PiecewiseLinearShape(20.0, (knots[0], knots[-1]), tuple(knots))
    temps = np.linspace(knots[0] - 0.5, knots[-1] + 0.5, 50)
    hats = shape.basis(temps)
    np.testing.assert_allclose(hats.sum(axis=1), 1.0, atol=10 * EPS)
    # Knots may be a hair apart where rounding to 3 degC parts them: T - knot loses there.
    closest = np.diff(knots).min()
    if closest > 0.1:
        np.testing.assert_allclose(hats @ np.array(knots), temps, atol=1e4 * EPS * 120)


def test_one_temperature_makes_a_constant_model():
    shape = PolynomialShape.over(np.array([20.3]), 20.0, 0)
    model = shape.model(TABLES[1][:, None])
    np.testing.assert_array_equal(model.constants_at(np.array([20.0, 25.0])), TABLES[[1, 1]])
    assert model.curves.breaks_degc[0] < 20.3 < model.curves.breaks_degc[1]


# What temperatures determine.


def test_a_knot_without_data_is_found():
    temps = np.array(SEVEN)
    shape = PiecewiseLinearShape.over(temps, 20.0, (-40.0, 5.0, 12.0, 15.0, 70.0))
    assert shape.undetermined_knot(temps) in (5.0, 12.0, 15.0)
    assert PiecewiseLinearShape.over(temps, 20.0, SEVEN).undetermined_knot(temps) is None
    assert PiecewiseLinearShape.over(temps, 20.0, None).undetermined_knot(temps) is None


def refusal(shape: ThermalShape, temps) -> str:
    reason = shape.undetermined("units/AT-TEST/unit.toml", np.array(temps))
    assert isinstance(reason, RefusedError)
    assert "\n" not in str(reason)
    return str(reason)


@pytest.mark.parametrize("order", [3, 4, 9])
def test_too_high_an_order_tells_the_highest_possible(order):
    message = refusal(PolynomialShape.over(np.array(TABLE_TEMPS), 20.0, order), TABLE_TEMPS)
    assert message == (
        f"units/AT-TEST/unit.toml, [thermal] order: order {order} with 3 calibrated temperatures "
        f"(-40, 20, 70 degC); expected {order + 1} temperatures for this order; "
        "the highest order possible is 2"
    )
    temps = np.array(TABLE_TEMPS)
    assert PolynomialShape.over(temps, 20.0, 2).undetermined("u", temps) is None


@pytest.mark.parametrize(
    ("knots", "named"),
    [((-40.0, 20.0, 45.0, 70.0), None), ((100.0,), "100"), ((-80.0, 20.0), "-80")],
)
def test_knots_that_nothing_determines(knots, named):
    temps = np.array(TABLE_TEMPS)
    message = refusal(PiecewiseLinearShape.over(temps, 20.0, knots), TABLE_TEMPS)
    assert message.startswith(
        "units/AT-TEST/unit.toml, [thermal] knots_degc: nothing determines the knot"
    )
    assert "calibrated temperatures are -40, 20, 70 degC" in message
    if named:
        assert f"the knot at {named} degC" in message


def test_without_a_temperature_the_order_or_a_knot_goes():
    temps = np.array(SEVEN)
    remaining = np.delete(temps, 2)  # 0 degC

    def reduced(shape):
        return shape.without(remaining, 0.0)

    assert reduced(PolynomialShape.over(temps, 20.0, 6)).order == 5
    assert reduced(PolynomialShape.over(temps, 20.0, 3)).order == 3
    assert reduced(PiecewiseLinearShape.over(temps, 20.0, None)).knots_degc == (-40.0, 20.0, 70.0)
    assert reduced(PiecewiseLinearShape.over(temps, 20.0, SEVEN)).knots_degc == tuple(remaining)
    # T0 left out: its knot stays, neighbours on both sides determine it.
    without_t0 = np.delete(temps, 3)
    kept = PiecewiseLinearShape.over(temps, 20.0, None).without(without_t0, 20.0)
    assert kept.knots_degc == (-40.0, 20.0, 70.0)
