"""Estimator and thermal fit together: exactness, the shift within a group, covariance."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fit_cases import SEVEN, TABLE_TEMPS, TABLES, cubic_truth, readings, tables_truth
from triaxcal.fitting.core.calibration import curve_covariance
from triaxcal.fitting.core.grouping import GroupedReadings, group_dwells, grouped_readings
from triaxcal.fitting.tilter.curves import (
    TilterData,
    fit_curves,
    parameter_covariance,
    shifted_voltage,
)
from triaxcal.fitting.tilter.estimators import constants_of, estimator_operators
from triaxcal.model.thermal.piecewise_linear import PiecewiseLinearShape
from triaxcal.model.thermal.polynomial import PolynomialShape
from triaxcal.unit.choices import ESTIMATORS

EPS = np.finfo(float).eps


def tilter_data(measurements, estimators=ESTIMATORS, g=1.0) -> TilterData:
    arrays = grouped_readings(group_dwells(measurements, 20.0), 0.0)
    count = len(arrays.temps_degc)
    operators = [estimator_operators(e, g, arrays.variance_v2, count) for e in estimators]
    return TilterData(arrays, np.stack(operators), g)


def amplification(shape, temps) -> float:
    """Largest sum of |coefficients| in the map from points to parameters."""
    return float(np.abs(np.linalg.pinv(shape.basis(temps))).sum(axis=1).max())


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("order", [3, 4, 6])
@pytest.mark.parametrize("g", [1.0, 0.9975])
def test_an_exact_cubic_comes_back_exactly(order, spread, g):
    truth = cubic_truth()
    data = tilter_data(readings(truth, SEVEN, gravity_g=g, spread_degc=spread, seed=3), g=g)
    shape = PolynomialShape.over(data.readings.temps_degc, 20.0, order)
    parameters = fit_curves(data, shape)
    temps = np.linspace(-40.0, 70.0, 45)
    found = np.swapaxes(shape.basis(temps) @ np.swapaxes(parameters, -1, -2), 0, 1)
    # Readings below 0.6 V are exact to an eps of it; the fit amplifies that. 20 for its own steps.
    tolerance = 20 * EPS * amplification(shape, data.readings.temps_degc)
    np.testing.assert_allclose(
        found, np.broadcast_to(truth(temps)[:, None], found.shape), atol=tolerance, rtol=0
    )


@pytest.mark.parametrize("spread", [0.0, 0.05])
def test_an_exact_broken_line_comes_back_exactly(spread):
    def truth(temp):
        return np.stack([np.interp(temp, TABLE_TEMPS, c) for c in TABLES.T], axis=-1)

    # Inside the ends, as the line is not known beyond.
    data = tilter_data(readings(truth, (-38.0, -10.0, 20.0, 45.0, 68.0), spread_degc=spread))
    shape = PiecewiseLinearShape.over(data.readings.temps_degc, 20.0, TABLE_TEMPS)
    parameters = fit_curves(data, shape)
    tolerance = 20 * EPS * amplification(shape, data.readings.temps_degc)
    np.testing.assert_allclose(
        parameters, np.broadcast_to(TABLES.T, (3, 12, 3)), atol=tolerance, rtol=0
    )


def test_equal_temperatures_are_left_alone_to_the_bit():
    data = tilter_data(readings(tables_truth, TABLE_TEMPS, sd_v=1e-6, seed=1))
    shape = PolynomialShape.over(data.readings.temps_degc, 20.0, 2)
    parameters = fit_curves(data, shape)
    shifted = shifted_voltage(data.readings, shape, parameters[0], 1.0)
    np.testing.assert_array_equal(shifted, data.readings.voltage_v)


def test_without_the_shift_readings_would_be_off_by_micro_g():
    truth = cubic_truth()
    data = tilter_data(readings(truth, SEVEN, spread_degc=0.05, seed=3))
    temps = data.readings.temps_degc
    plain = constants_of(data.operators[1], data.readings.voltage_v)
    assert np.abs(plain - truth(temps)).max() > 1e-6  # V: 2 micro-g
    shape = PolynomialShape.over(temps, 20.0, 3)
    shifted = shifted_voltage(data.readings, shape, fit_curves(data, shape)[1], 1.0)
    np.testing.assert_allclose(constants_of(data.operators[1], shifted), truth(temps), atol=1e-14)


def rounds(data: TilterData, shape, estimator: int, count: int):
    """Fit, shift, fit again: the parameters after each round, by plain least squares."""
    temps = data.readings.temps_degc
    voltage = data.readings.voltage_v
    for _ in range(count):
        points = constants_of(data.operators[estimator], voltage)
        parameters = np.linalg.lstsq(shape.basis(temps), points)[0].T
        yield parameters
        voltage = shifted_voltage(data.readings, shape, parameters, data.gravity_g)


@pytest.mark.parametrize("estimator", range(3))
@pytest.mark.parametrize("kind", ["cubic", "broken line"])
def test_the_solution_is_where_rounds_of_fitting_and_shifting_end(kind, estimator):
    data = tilter_data(readings(cubic_truth(), SEVEN, spread_degc=0.05, sd_v=1e-6, seed=2))
    temps = data.readings.temps_degc
    shape = PolynomialShape.over(temps, 20.0, 3)
    if kind == "broken line":
        shape = PiecewiseLinearShape.over(temps, 20.0, None)
    direct = fit_curves(data, shape)[estimator]
    distance = [np.abs(p - direct).max() for p in rounds(data, shape, estimator, 5)]
    floor = 20 * EPS * amplification(shape, temps)
    # Spread 0.1 degC against groups 15 degC apart, amplified by the fit: each round gains 20 times.
    for before, after in pairwise(distance):
        assert after <= max(before / 20.0, floor)
    assert distance[0] > 1e-8
    assert distance[4] <= 1e-13


def test_exact_interpolation_and_least_squares_agree():
    truth = cubic_truth()
    few = tilter_data(readings(truth, (-40.0, -10.0, 20.0, 70.0)))
    many = tilter_data(readings(truth, SEVEN))
    fits = []
    for data in (few, many):
        shape = PolynomialShape.over(np.array([-40.0, 70.0]), 20.0, 3)
        fits.append(fit_curves(data, shape))
    tolerance = 20 * EPS * amplification(shape, few.readings.temps_degc)
    np.testing.assert_allclose(fits[0], fits[1], atol=tolerance, rtol=0)


def test_thermal_fit_is_weighted_by_the_points_variances():
    random = np.random.default_rng(8)
    temps = np.array(SEVEN)
    voltage = random.normal(size=(7, 6, 3))
    variance = np.broadcast_to(10.0 ** random.uniform(-3, 0, (7, 1, 3)), (7, 6, 3))
    arrays = GroupedReadings(temps, np.broadcast_to(temps[:, None], (7, 6)), voltage, variance)
    operators = estimator_operators("equation-10", 1.0, variance, 7)
    shape = PolynomialShape.over(temps, 20.0, 2)
    found = fit_curves(TilterData(arrays, operators[None], 1.0), shape)[0]
    points = constants_of(operators, voltage)
    for c in range(12):
        output = c // 3 if c < 9 else c - 9
        root = 1.0 / np.sqrt(variance[:, 0, output])
        expected = np.linalg.lstsq(root[:, None] * shape.basis(temps), root * points[:, c])[0]
        # Weights over three decades: a normal matrix conditioned to 1e3.
        np.testing.assert_allclose(found[c], expected, atol=1e3 * 100 * EPS)


@pytest.mark.parametrize("estimator", range(3))
def test_parameter_covariance_propagates_the_readings(estimator):
    """The fit is linear in the readings: its derivative by each one gives the covariance."""
    measurements = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=9, spread_degc=0.5)
    data = tilter_data(measurements).only(estimator)
    temps = data.readings.temps_degc
    shape = PolynomialShape.over(temps, 20.0, 3)
    variance = data.readings.variance_v2
    assert variance is not None
    covariance = parameter_covariance(data, shape, variance)[0]
    at = np.array([-40.0, 3.0, 20.0, 66.0])
    jacobian = np.zeros((4, 12, 126))
    for k in range(126):
        one = np.zeros((7, 6, 3))
        one.flat[k] = 1.0
        arrays = GroupedReadings(temps, data.readings.dwell_temps_degc, one, variance)
        parameters = fit_curves(TilterData(arrays, data.operators, 1.0), shape)[0]
        jacobian[:, :, k] = shape.basis(at) @ parameters.T
    expected = (jacobian * variance.ravel()) @ np.swapaxes(jacobian, 1, 2)
    found = curve_covariance(shape, covariance, at)
    np.testing.assert_allclose(found, expected, atol=1e4 * EPS * expected.max(), rtol=0)


def test_the_covariance_allows_the_errors_that_noise_makes():
    """Errors of 300 units at 3 temperatures, normalised by their covariance: chi-square."""
    truth, draws = cubic_truth(), 300
    random = np.random.default_rng(21)
    clean = readings(truth, SEVEN, sd_v=np.array([1e-6, 2e-6, 5e-7]), count=50, spread_degc=0.2)
    base = tilter_data(clean)
    uneven = base.readings.variance_v2 * random.uniform(0.2, 3.0, (7, 6, 1))
    exact = GroupedReadings(
        base.readings.temps_degc,
        base.readings.dwell_temps_degc,
        tilter_data(readings(truth, SEVEN, spread_degc=0.2)).readings.voltage_v,
        uneven,
    )
    at = np.array([-40.0, 10.0, 62.0])
    shape = PolynomialShape.over(exact.temps_degc, 20.0, 3)
    operators = [estimator_operators(e, 1.0, uneven, 7) for e in ESTIMATORS]
    data = TilterData(exact, np.stack(operators), 1.0)
    inverse = np.linalg.inv(
        [curve_covariance(shape, c, at) for c in parameter_covariance(data, shape, uneven)]
    )
    total = np.zeros((3, 3))
    for _ in range(draws):
        noisy = exact.voltage_v + np.sqrt(uneven) * random.normal(size=(7, 6, 3))
        arrays = GroupedReadings(exact.temps_degc, exact.dwell_temps_degc, noisy, uneven)
        parameters = fit_curves(TilterData(arrays, data.operators, 1.0), shape)
        error = shape.basis(at) @ np.swapaxes(parameters, -1, -2) - truth(at)
        total += np.einsum("eti,etij,etj->et", error, inverse, error)
    # Each sum is chi-square with 12 x 300 degrees of freedom, sd sqrt(2 n): 5 of them.
    n = 12 * draws
    assert np.all(np.abs(total - n) < 5.0 * np.sqrt(2.0 * n))
