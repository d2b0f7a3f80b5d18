"""The choice by held-out error: what it picks, what it says, what it refuses to decide."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fit_cases import (
    SEVEN,
    TABLE_TEMPS,
    TABLES,
    cubic_truth,
    readings,
    tables_truth,
    unit,
    with_checks,
)
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.calibrate import calibrate, candidate_shapes
from triaxcal.fitting.tilter.selection import PREFERENCE
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.choices import ESTIMATORS
from triaxcal.unit.thermal import ThermalChoice

BETWEEN = (-30.0, -10.0, 10.0, 30.0, 62.0)


def chosen_row(calibration: Calibration):
    (row,) = [c for c in calibration.candidates if c.chosen]
    assert row.estimator == calibration.estimator
    assert row.shape == calibration.shape
    return row


def broken_line(temp):
    return np.stack([np.interp(temp, TABLE_TEMPS, c) for c in TABLES.T], axis=-1)


@pytest.mark.parametrize("checks", [(), BETWEEN], ids=["no checks", "checks"])
@pytest.mark.parametrize("sd_v", [1e-7, 1e-6, 1e-5])
def test_a_cubic_with_noise_is_found_cubic(sd_v, checks):
    for seed in range(6):
        noise = {"sd_v": sd_v, "count": 100}
        data = readings(cubic_truth(), SEVEN, **noise, spread_degc=0.05, seed=seed)
        data = with_checks(data, cubic_truth(), checks, **noise, seed=100 + seed)
        calibration = calibrate(unit(), data)
        assert chosen_row(calibration).label == "polynomial of order 3"
        # Noise alone does not part the estimators.
        assert calibration.estimator == "least-squares"


def test_a_broken_line_is_found_piecewise_linear():
    temps = (-39.9, -20.0, 0.0, 20.0, 40.0, 55.0, 69.9)
    data = readings(broken_line, temps, sd_v=1e-6, count=100, seed=3)
    row = chosen_row(calibrate(unit(), data))
    assert row.shape.name == "piecewise-linear"
    assert row.shape.knots_degc == (-39.9, 20.0, 69.9)


def test_a_jagged_line_takes_a_knot_at_every_temperature():
    """Only check dwells can tell: with a temperature left out its own corner is not seen."""
    random = np.random.default_rng(5)
    corners = TABLES[1] + 5e-4 * random.uniform(-1, 1, (7, 12))

    def jagged(temp):
        return np.stack([np.interp(temp, SEVEN, c) for c in corners.T], axis=-1)

    between = [(a + b) / 2 for a, b in pairwise(SEVEN)] * 20
    data = with_checks(readings(jagged, SEVEN, sd_v=1e-7, count=9), jagged, between, sd_v=1e-7)
    assert chosen_row(calibrate(unit(), data)).shape.knots_degc == SEVEN


def test_imperfect_placement_prefers_the_half_sum():
    """A tilt of a millirad moves level outputs by 1 mg, upright ones by 0.5 micro-g only.

    Check dwells see |a| alone, which no tilt changes: they part the estimators of U0.
    """
    random = np.random.default_rng(12)
    truth = cubic_truth()
    clean = readings(truth, SEVEN)
    dwells = []
    for d in clean.dwells:
        force = np.array(TEST_POSITIONS[d.position], dtype=float)
        tilted = force + np.cross(random.normal(size=3) * 1e-3, force)
        K, U0 = unpack_constants(truth(np.array(d.temp_degc)))
        dwells.append(replace(d, voltage_v=K @ (tilted / np.linalg.norm(tilted)) + U0))
    data = with_checks(MeasurementSet(clean.source, tuple(dwells)), truth, BETWEEN * 8)
    choice = ThermalChoice("polynomial", {"order": 3})
    calibration = calibrate(unit(thermal=choice), data)
    scores = {c.estimator: c.held_out_g for c in calibration.candidates}
    assert set(scores) == set(ESTIMATORS)
    assert min(scores, key=scores.get) == "half-sum" == calibration.estimator


def test_three_temperatures_alone_take_the_two_segments_of_the_paper():
    calibration = calibrate(unit(), readings(tables_truth, TABLE_TEMPS))
    row = chosen_row(calibration)
    assert (row.shape.name, row.shape.knots_degc, row.parameters) == (
        "piecewise-linear",
        TABLE_TEMPS,
        3,
    )
    assert row.estimator == "least-squares"
    assert all(c.held_out_g is None for c in calibration.candidates)
    assert calibration.selection_reason == (
        "piecewise-linear, knots -40, 20, 70 degC, bias by least squares: nothing can be held out "
        "(3 temperatures, no check dwells among them), so this is the simplest that the data "
        "determine exactly"
    )


def test_fewer_temperatures_take_what_they_determine():
    one = calibrate(unit(), readings(tables_truth, (20.0,)))
    assert chosen_row(one).label == "polynomial of order 0"
    two = calibrate(unit(), readings(tables_truth, (20.0, 70.0)))
    assert chosen_row(two).label == "polynomial of order 1"
    assert "(1 temperature, no check dwells" in one.selection_reason


def test_three_temperatures_with_check_dwells_are_compared_on_these():
    truth = cubic_truth()
    parabola = readings(broken_line, TABLE_TEMPS)
    data = with_checks(parabola, broken_line, BETWEEN, sd_v=1e-6)
    calibration = calibrate(unit(), data)
    assert chosen_row(calibration).shape.name == "piecewise-linear"
    assert "over 30 values (30 check dwells)" in calibration.selection_reason
    assert all(c.held_out_g is not None for c in calibration.candidates)
    # The cubic is nearer to a parabola than to two segments.
    data = with_checks(readings(truth, TABLE_TEMPS), truth, BETWEEN, sd_v=1e-6)
    assert chosen_row(calibrate(unit(), data)).label == "polynomial of order 2"


def test_check_dwells_outside_the_calibrated_temperatures_are_not_scored():
    data = with_checks(readings(tables_truth, TABLE_TEMPS), cubic_truth(), (-45.0, 80.0))
    calibration = calibrate(unit(), data)
    assert "nothing can be held out" in calibration.selection_reason
    assert len(calibration.check_dwells) == 12  # shown all the same


def test_the_fit_residual_does_not_decide():
    data = readings(cubic_truth(), SEVEN, sd_v=1e-5, count=100, seed=1)
    calibration = calibrate(unit(), data)
    row = chosen_row(calibration)
    same = [c for c in calibration.candidates if c.estimator == row.estimator]
    assert row.fit_residual_g > min(c.fit_residual_g for c in same)
    polynomials = [c for c in same if c.shape.name == "polynomial"]
    residuals = [c.fit_residual_g for c in polynomials]
    assert residuals == sorted(residuals, reverse=True)
    # Simplest within one standard error of the best, 18 values for each of 5 temperatures.
    best = min(c.held_out_g for c in calibration.candidates)
    assert row.held_out_g <= best * (1.0 + 1.0 / np.sqrt(2.0 * 90))
    assert all(
        c.held_out_g > best * (1.0 + 1.0 / np.sqrt(2.0 * 90))
        for c in same
        if c.parameters < row.parameters
    )


def test_held_out_error_is_that_of_a_fit_without_the_temperature():
    data = readings(cubic_truth(), SEVEN, sd_v=1e-5, seed=4)
    choice = ThermalChoice("polynomial", {"order": 2})
    calibration = calibrate(unit(thermal=choice, estimator="equation-10"), data)
    squares = []
    for temp in SEVEN[1:-1]:
        # At T0 there must be dwells: T0 moves, which does not change a parabola.
        t0 = 0.0 if temp == 20.0 else 20.0
        rest = MeasurementSet("m.csv", tuple(d for d in data.dwells if d.temp_degc != temp))
        fit = calibrate(unit(thermal=choice, estimator="equation-10", t0_degc=t0), rest)
        K, U0 = unpack_constants(fit.thermal.constants_at(temp))
        for d in data.dwells:
            if d.temp_degc == temp:
                force = np.linalg.solve(K, d.voltage_v - U0)
                squares.extend((force - np.array(TEST_POSITIONS[d.position])) ** 2)
    assert len(squares) == 90
    # Parabolas solved in two bases: a few hundred eps of 1 g on errors of 1e-4 g.
    expected = np.sqrt(np.mean(squares))
    assert calibration.candidates[0].held_out_g == pytest.approx(expected, rel=1e-9)


def test_an_explicit_choice_is_alone_and_still_scored():
    data = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=100)
    thermal = ThermalChoice("polynomial", {"order": 5})
    calibration = calibrate(unit(thermal=thermal, estimator="half-sum"), data)
    (row,) = calibration.candidates
    assert (row.shape.order, row.estimator, row.chosen) == (5, "half-sum", True)
    assert row.held_out_g is not None
    assert "thermal function from unit.toml; held-out error" in calibration.selection_reason
    assert "the only candidate" in calibration.selection_reason


def test_an_explicit_estimator_leaves_the_function_open():
    data = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=100)
    calibration = calibrate(unit(estimator="equation-10"), data)
    assert {c.estimator for c in calibration.candidates} == {"equation-10"}
    assert chosen_row(calibration).shape.order == 3


def test_polynomial_without_an_order_is_chosen_among_polynomials():
    data = readings(broken_line, SEVEN, sd_v=1e-6, count=100)
    calibration = calibrate(unit(thermal=ThermalChoice("polynomial")), data)
    assert {c.shape.name for c in calibration.candidates} == {"polynomial"}


def test_the_table_has_each_function_once_and_each_estimator():
    for temps in (SEVEN, [10.0 * i for i in range(-4, 8)]):
        data = readings(cubic_truth(), temps, sd_v=1e-6, count=100)
        rows = calibrate(unit(), data).candidates
        labels = [c.label for c in rows if c.estimator == "least-squares"]
        assert len(labels) == len(set(labels)) == min(len(temps), 8) + 4
        assert len(rows) == len(labels) + len(PREFERENCE) - 1 <= 14


def test_shapes_offered():
    def labels(temps):
        return [s.label for s in candidate_shapes(unit(), np.array(temps))]

    assert labels((20.0,)) == ["polynomial of order 0"]
    assert len(labels((20.0, 70.0))) == 2
    assert labels(TABLE_TEMPS)[-1] == "piecewise-linear, knots -40, 20, 70 degC"
    assert len(labels(TABLE_TEMPS)) == 4
    assert labels((-40.0, 0.0, 20.0, 70.0))[4:] == [
        "piecewise-linear, knots -40, 20, 70 degC",
        "piecewise-linear, knots -40, 0, 20, 70 degC",
        "natural cubic spline, knots -40, 20, 70 degC",
        "natural cubic spline, knots -40, 0, 20, 70 degC",
    ]
    # T0 at an end: lowest and highest only, and every temperature.
    assert labels((20.0, 30.0, 50.0, 70.0))[4:] == [
        "piecewise-linear, knots 20, 70 degC",
        "piecewise-linear, knots 20, 30, 50, 70 degC",
        "natural cubic spline, knots 20, 30, 50, 70 degC",
    ]
