"""Compensation methods of P1: what they cost on its tables, and that they are what they say."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plans import TABLE_T0
from strategies import constants, forces_g
from triaxcal.base.tomltable import read_toml
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.matrix import MAX_ORDER
from triaxcal.model.methods.method import DIRECT, INVERSE
from triaxcal.model.metrological import (
    CONSTANT_NAMES,
    exact_gain_and_offset,
    force_from_voltage,
    pack_constants,
    unpack_constants,
    voltage_from_force,
    worst_force_error_g,
)
from triaxcal.model.types import FloatArray

TABLES = read_toml(Path(__file__).parent.parent / "units" / "AT-CHERNIAK" / "tables.toml")[
    "constants"
]
assert isinstance(TABLES, dict)
TEMPS = tuple(float(t) for t in TABLES["temp_degc"])
POINTS = np.array([[float(v) for v in TABLES[name]] for name in CONSTANT_NAMES]).T
RANGE = (-40.0, 70.0)
VOLTAGE_MAX_V = 2.5
EPS = np.finfo(np.float64).eps
ADDITIVE = ("additive", "additive-simplified", "additive-first-order")


def two_segments() -> ThermalModel:
    """P1 (12) on tables 1 and 2: straight from each end to +20 degC."""
    slopes = [(b - a) / (t1 - t0) for (t0, a), (t1, b) in pairwise(zip(TEMPS, POINTS, strict=True))]
    rows = np.array([np.column_stack([POINTS[1], slope]) for slope in slopes])
    return ThermalModel(20.0, PiecewisePolynomial(TEMPS, (20.0, 20.0), rows))


def parabola() -> ThermalModel:
    """P1 (11) on the same points."""
    powers = np.vander(np.array(TEMPS) - 20.0, 3, increasing=True)
    rows = np.linalg.solve(powers, POINTS).T[None]
    return ThermalModel(20.0, PiecewisePolynomial(RANGE, (20.0,), rows))


def compensation(method: str, thermal: ThermalModel | None = None) -> Compensation:
    return compensate(thermal or two_segments(), method, RANGE, VOLTAGE_MAX_V, 1e-6)


def force(found: Compensation, voltage_v: FloatArray, temp_degc: float) -> FloatArray:
    N, b = found.gain_and_offset(temp_degc)
    result: FloatArray = voltage_v @ N.T + b
    return result


# ---- the numbers of method 2 ----


def orientations(count: int) -> FloatArray:
    """Unit vectors, uniform over the sphere."""
    v = np.random.default_rng(5).standard_normal((count, 3))
    result: FloatArray = v / np.linalg.norm(v, axis=1, keepdims=True)
    return result


def uncorrected(voltage_v: FloatArray) -> FloatArray:
    return force_from_voltage(POINTS[1], voltage_v)


def right_sign(method: str, voltage_v: FloatArray, temp_degc: float) -> FloatArray:
    return force(compensation(method), voltage_v, temp_degc)


def printed_sign(method: str, voltage_v: FloatArray, temp_degc: float) -> FloatArray:
    """a - Delta_a, as P1 prints it."""
    delta = right_sign(method, voltage_v, temp_degc) - uncorrected(voltage_v)
    return uncorrected(voltage_v) - delta


# Largest error of any axis over all orientations, mg, as theory.md prints it: at -40, +70.
METHOD_2 = {
    "uncorrected": ("14.2", "5.2"),
    "printed sign of (5), (6)": ("28.5", "10.5"),
    "(5), (6)": ("0.059", "0.114"),
    "first order": ("0.023", "0.010"),
}


def method_2_force(case: str, voltage_v: FloatArray, temp_degc: float) -> FloatArray:
    if case == "uncorrected":
        return uncorrected(voltage_v)
    if case.startswith("printed"):
        return printed_sign("additive", voltage_v, temp_degc)
    method = "additive" if case == "(5), (6)" else "additive-first-order"
    return right_sign(method, voltage_v, temp_degc)


@pytest.mark.parametrize("case", METHOD_2)
@pytest.mark.parametrize("end", [0, 1])
def test_method_2_costs_what_theory_says(case: str, end: int) -> None:
    constants_then, temp = POINTS[2 * end], TEMPS[2 * end]

    def error_g(true_g: FloatArray) -> FloatArray:
        found = method_2_force(case, voltage_from_force(constants_then, true_g), temp)
        return found - true_g

    # The error is affine in the force, E a + c: over unit vectors an axis reaches |E_i| + |c_i|.
    offset = error_g(np.zeros((1, 3)))[0]
    E = np.array([error_g(np.eye(3)[j : j + 1])[0] - offset for j in range(3)]).T
    largest_mg = 1e3 * float((np.linalg.norm(E, axis=1) + np.abs(offset)).max())
    printed = METHOD_2[case][end]
    last_digit = 10.0 ** -len(printed.split(".")[1])
    assert abs(largest_mg - float(printed)) <= 0.5 * last_digit

    # Random orientations stay below, and the worst of 20 000 comes within 1 % of the square of its
    # angle: cos(angle) > 0.99 needs 8 deg, where one expects 100 of them.
    sampled_mg = 1e3 * float(np.abs(error_g(orientations(20_000))).max())
    assert 0.99 * largest_mg <= sampled_mg <= largest_mg * (1 + 1e-9)


@pytest.mark.parametrize("end", [0, 1])
def test_the_printed_sign_doubles_the_error(end: int) -> None:
    true_g = orientations(500)
    voltage = voltage_from_force(POINTS[2 * end], true_g)
    temp = TEMPS[2 * end]
    for method in ADDITIVE:
        # a - Delta has the error 2 (a - true) - (a + Delta - true).
        doubled = 2 * (uncorrected(voltage) - true_g)
        rest = right_sign(method, voltage, temp) - true_g
        printed = printed_sign(method, voltage, temp) - true_g
        assert np.abs(printed - (doubled - rest)).max() <= 16 * EPS
        assert np.abs(printed).max() > 1.8 * np.abs(uncorrected(voltage) - true_g).max()
        assert np.abs(rest).max() < 0.2 * np.abs(uncorrected(voltage) - true_g).max()


# ---- each Delta_a is the derivative that it says ----


def delta_a(
    method: str, at_t0: FloatArray, change: FloatArray, voltage_v: FloatArray
) -> FloatArray:
    """Delta_a of a method for a change of the twelve constants, out of the product's functions."""
    rows = np.stack([at_t0, change], axis=1)[None]
    curves = PiecewisePolynomial((0.0, 2.0), (0.0,), rows)
    thermal = ThermalModel(0.0, curves)
    found = compensate(thermal, method, (0.0, 2.0), VOLTAGE_MAX_V, 1e-6)
    difference: FloatArray = force(found, voltage_v, 1.0) - force(found, voltage_v, 0.0)
    return difference


def finite_difference(
    at_t0: FloatArray, change: FloatArray, voltage_v: FloatArray
) -> tuple[FloatArray, float]:
    """Central difference of K^-1 (U - U0) along a change, and a bound of its error.

    With r = |N dK| the force is a geometric series in r; the third derivative is at most
    6 r^2 (r |a| + |N dU0|) / (1 - r)^4. Rounding of the two forces is divided by the step.
    """
    step = 1e-4
    forces = [force_from_voltage(at_t0 + s * change, voltage_v) for s in (step, -step)]
    K, _ = unpack_constants(at_t0)
    dK, dU0 = unpack_constants(change)
    N = np.linalg.inv(K)
    r, bias = np.linalg.norm(N @ dK, 2), float(np.linalg.norm(N @ dU0))
    largest = float(np.abs(forces).max()) * np.sqrt(3)
    truncation = step**2 * r**2 * (r * largest + bias) / (1 - r) ** 4
    rounding = 40 * EPS * np.linalg.cond(K) * max(largest, 1.0) / step
    return (forces[0] - forces[1]) / (2 * step), float(truncation + rounding)


@st.composite
def changes(draw: st.DrawFn) -> FloatArray:
    """Changes of twelve constants as in tables 1 and 2: to 3e-3 V/g and 12 mV."""
    K = [draw(st.floats(-3e-3, 3e-3)) for _ in range(9)]
    return np.array(K + [draw(st.floats(-0.012, 0.012)) for _ in range(3)])


@given(at_t0=constants(), change=changes(), true_g=forces_g())
def test_first_order_form_is_the_derivative(
    at_t0: FloatArray, change: FloatArray, true_g: FloatArray
) -> None:
    voltage = voltage_from_force(at_t0, true_g)
    expected, tolerance = finite_difference(at_t0, change, voltage)
    found = delta_a("additive-first-order", at_t0, change, voltage)
    assert np.abs(found - expected).max() <= tolerance


def diagonal(at_t0: FloatArray) -> FloatArray:
    result = at_t0.copy()
    result[[1, 2, 3, 5, 6, 7]] = 0.0
    return result


@given(at_t0=constants(), change=changes(), true_g=forces_g())
def test_5_and_6_are_the_derivative_where_no_axis_leans(
    at_t0: FloatArray, change: FloatArray, true_g: FloatArray
) -> None:
    straight = diagonal(at_t0)
    voltage = voltage_from_force(straight, true_g)
    expected, tolerance = finite_difference(straight, change, voltage)
    assert np.abs(delta_a("additive", straight, change, voltage) - expected).max() <= tolerance


@given(at_t0=constants(), change=changes(), true_g=forces_g())
def test_7_and_8_are_the_derivative_without_cross_terms(
    at_t0: FloatArray, change: FloatArray, true_g: FloatArray
) -> None:
    straight, along = diagonal(at_t0), diagonal(change)
    voltage = voltage_from_force(straight, true_g)
    expected, tolerance = finite_difference(straight, along, voltage)
    found = delta_a("additive-simplified", straight, along, voltage)
    assert np.abs(found - expected).max() <= tolerance


@given(at_t0=constants(), change=changes(), true_g=forces_g())
def test_what_5_and_6_leave_out_is_of_the_size_of_the_cross_terms(
    at_t0: FloatArray, change: FloatArray, true_g: FloatArray
) -> None:
    # (2) leaves out the squares of c = |K_ij / K_ii|, the matrix part of (5), (6) takes
    # 1 / K_ii for both inverses: at most (2 c' + c'^2) |N dK| |a| with c' = |N - diag| / |diag|.
    K, _ = unpack_constants(at_t0)
    dK, dU0 = unpack_constants(change)
    N, D = np.linalg.inv(K), np.diag(1 / np.diag(K))
    voltage = voltage_from_force(at_t0, true_g)
    tilt = np.linalg.norm(N - D, 2) / np.linalg.norm(D, 2)
    second = np.linalg.norm(N - (2 * D - D @ K @ D), 2)  # (2) is D - D (K - diag) D
    size = np.linalg.norm(D, 2) * np.linalg.norm(dK, 2)
    allowed = (2 * tilt + tilt**2) * size * np.linalg.norm(K @ true_g) * np.linalg.norm(D, 2)
    allowed += second * np.linalg.norm(dU0)
    full = delta_a("additive-first-order", at_t0, change, voltage)
    found = delta_a("additive", at_t0, change, voltage)
    assert np.linalg.norm(found - full) <= allowed * (1 + 1e-6) + 64 * EPS


@pytest.mark.parametrize("method", ADDITIVE)
@pytest.mark.parametrize("thermal", [two_segments(), parabola()], ids=["segments", "parabola"])
def test_additive_methods_follow_the_curves(method: str, thermal: ThermalModel) -> None:
    """At any temperature Delta_a is that of the constants' change there; at T0 it is nothing."""
    found = compensate(thermal, method, RANGE, VOLTAGE_MAX_V, 1e-6)
    assert found.form == DIRECT
    voltage = voltage_from_force(POINTS[1], orientations(20))
    at_t0 = thermal.constants_at(20.0)
    plain = force_from_voltage(at_t0, voltage)
    for temp in (-40.0, -17.3, 19.999, 20.0, 33.0, 70.0):
        change = thermal.constants_at(temp) - at_t0
        expected = plain + delta_a(method, at_t0, change, voltage)
        # Forces of 1 g through curves of magnitudes to 4: some tens of roundings.
        assert np.abs(force(found, voltage, temp) - expected).max() <= 100 * EPS
    assert np.abs(force(found, voltage, 20.0) - plain).max() <= 100 * EPS


# ---- matrix and inverse ----


@pytest.mark.parametrize("thermal", [two_segments(), parabola()], ids=["segments", "parabola"])
def test_inverse_is_exact_everywhere(thermal: ThermalModel) -> None:
    found = compensation("inverse", thermal)
    assert found.form == INVERSE
    for temp in (*TEMPS, -33.3, 0.0, 19.5, 50.1):
        N, b = found.gain_and_offset(temp)
        exact = exact_gain_and_offset(thermal.constants_at(temp))
        assert np.array_equal(N, exact[0])
        assert np.array_equal(b, exact[1])


@pytest.mark.parametrize("method", ["matrix", "inverse"])
@pytest.mark.parametrize("thermal", [two_segments(), parabola()], ids=["segments", "parabola"])
def test_methods_1_are_exact_at_the_calibration_temperatures(
    method: str, thermal: ThermalModel
) -> None:
    found = compensation(method, thermal)
    true_g = orientations(200)
    stated = worst_force_error_g(
        found.gain_and_offset(np.linspace(*RANGE, 2001)),
        exact_gain_and_offset(thermal.constants_at(np.linspace(*RANGE, 2001))),
        VOLTAGE_MAX_V,
    ).max()
    if method == "inverse":
        assert stated == 0.0
    assert stated <= 1e-6
    for temp, point in zip(TEMPS, POINTS, strict=True):
        voltage = voltage_from_force(point, true_g)
        # Rounding: the curves' constants to 1e-16 relative, conditioned by K (1.1), and a solve.
        error = np.abs(force(found, voltage, temp) - true_g).max()
        assert error <= stated + 100 * EPS, temp


@pytest.mark.parametrize("thermal", [two_segments(), parabola()], ids=["segments", "parabola"])
def test_the_order_of_the_matrix_is_the_lowest_that_does(thermal: ThermalModel) -> None:
    temps = np.linspace(*RANGE, 5003)
    exact = exact_gain_and_offset(thermal.constants_at(temps))
    orders = []
    for limit_g in (1e-3, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12):
        found = compensate(thermal, "matrix", RANGE, VOLTAGE_MAX_V, limit_g)
        orders.append(found.curves.order)
        error = worst_force_error_g(found.gain_and_offset(temps), exact, VOLTAGE_MAX_V).max()
        # The planner samples 1001 temperatures; between them the error rises by less than 1 %.
        assert error <= 1.01 * limit_g
        if found.curves.order > 1:
            # Of the best polynomial one order lower, an equally spaced least-squares fit is near:
            # Chebyshev interpolation is within a factor 2 of it, so the limit is out of reach.
            assert best_error_g(thermal, found, temps) > 0.5 * limit_g
    assert orders == sorted(orders)
    assert len(set(orders)) > 2


def best_error_g(thermal: ThermalModel, found: Compensation, temps: FloatArray) -> float:
    """Largest error of the least-squares polynomial of one order less on each segment."""
    worst = 0.0
    for low, high in pairwise(found.curves.breaks_degc):
        inside = temps[(temps >= low) & (temps < high)]
        x = (inside - (low + high) / 2) / ((high - low) / 2)
        exact = exact_gain_and_offset(thermal.constants_at(inside))
        powers = np.vander(x, found.curves.order)
        fitted = powers @ np.linalg.lstsq(powers, pack_constants(*exact), rcond=None)[0]
        error = worst_force_error_g(unpack_constants(fitted), exact, VOLTAGE_MAX_V)
        worst = max(worst, float(error.max()))
    return worst


def test_an_error_out_of_reach_ends_at_the_highest_order() -> None:
    found = compensate(parabola(), "matrix", RANGE, VOLTAGE_MAX_V, 1e-30)
    assert found.curves.order == MAX_ORDER


@given(a=st.lists(st.floats(-2, 2), min_size=24, max_size=24), voltage_max_v=st.floats(0.1, 10.0))
def test_worst_force_error_is_that_of_the_worst_corner(
    a: list[float], voltage_max_v: float
) -> None:
    pair = [unpack_constants(np.array(a[i : i + 12])) for i in (0, 12)]
    found = worst_force_error_g(pair[0], pair[1], voltage_max_v)
    corners = np.array(np.meshgrid(*[[-voltage_max_v, voltage_max_v]] * 3)).reshape(3, 8)
    errors = [(N @ corners) + b[:, None] for N, b in pair]
    expected = np.abs(errors[0] - errors[1]).max(axis=1)
    assert np.allclose(found, expected, rtol=0, atol=200 * EPS * voltage_max_v * 8)


# ---- ranges ----


@pytest.mark.parametrize(
    ("range_degc", "breaks"),
    [
        ((-40.0, 70.0), (-40.0, 20.0, 70.0)),
        ((-10.0, 30.0), (-10.0, 20.0, 30.0)),
        ((-40.0, 10.0), (-40.0, 10.0)),
        ((-40.0, 20.0), (-40.0, 20.0)),
        ((20.0, 70.0), (20.0, 70.0)),
        ((25.0, 26.0), (25.0, 26.0)),
        ((-40.5, 70.5), (-40.5, 20.0, 70.5)),
    ],
)
@pytest.mark.parametrize("method", ["matrix", "inverse", *ADDITIVE])
def test_only_the_segments_of_the_range_are_kept(
    method: str, range_degc: tuple[float, float], breaks: tuple[float, ...]
) -> None:
    thermal = two_segments()
    found = compensate(thermal, method, range_degc, VOLTAGE_MAX_V, 1e-6)
    assert found.curves.breaks_degc == breaks
    whole = compensate(thermal, method, RANGE, VOLTAGE_MAX_V, 1e-6)
    for temp in np.linspace(max(breaks[0], -40.0), min(breaks[-1], 70.0) - 1e-9, 7):
        error = worst_force_error_g(
            found.gain_and_offset(temp), whole.gain_and_offset(temp), VOLTAGE_MAX_V
        )
        assert error.max() <= (2e-6 if method == "matrix" else 200 * EPS)


def test_tables_are_those_of_the_builders() -> None:
    assert np.array_equal(POINTS[1], np.array(TABLE_T0))
