"""From measurements to a calibration: the whole, its refusals, its invariances, its covariance."""

from __future__ import annotations

import random
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.curves import relative_coefficients
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.thermal import ThermalChoice

EPS = np.finfo(float).eps
CUBIC = ThermalChoice("polynomial", {"order": 3})
TWO_SEGMENTS = ThermalChoice("piecewise-linear")


def refusal(measurements: MeasurementSet, **changes) -> str:
    with pytest.raises(RefusedError) as caught:
        calibrate(unit(**changes), measurements)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def assert_same(one: Calibration, other: Calibration) -> None:
    for field in fields(Calibration):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "thermal":
            np.testing.assert_array_equal(a.curves.coefficients, b.curves.coefficients)
        elif field.name == "points":
            for p, q in zip(a, b, strict=True):
                np.testing.assert_array_equal(p.constants, q.constants)
                np.testing.assert_array_equal(p.covariance, q.covariance)
        elif field.name == "parameter_covariance":
            np.testing.assert_array_equal(a, b)
        elif field.name == "squares":
            for name in ("per_g", "sd_per_g"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        elif field.name != "check_dwells":
            assert a == b, field.name


def test_the_published_unit():
    calibration = calibrate(unit(), readings(tables_truth, TABLE_TEMPS))
    assert calibration.range_degc == (-40.0, 70.0)
    assert calibration.serial == "T-1"
    for point, temp, expected in zip(calibration.points, TABLE_TEMPS, TABLES, strict=True):
        assert point.temp_degc == temp
        np.testing.assert_allclose(point.constants, expected, atol=20 * EPS, rtol=0)
        np.testing.assert_allclose(
            calibration.thermal.constants_at(temp), expected, atol=50 * EPS, rtol=0
        )
        assert point.position_residual_g < 100 * EPS
        assert point.curve_residual_g < 200 * EPS
    # gamma_xy of Table 3, to its last digit but one.
    gamma = relative_coefficients(calibration.thermal)[:, 1, 0]
    np.testing.assert_allclose(gamma, [0.004127, -0.003445], atol=5e-7)


@pytest.mark.parametrize("estimator", ["equation-10", "least-squares", "half-sum"])
@pytest.mark.parametrize("g", [1.0, 0.99756])
def test_exact_readings_give_the_truth(estimator, g):
    truth = cubic_truth()
    data = readings(truth, SEVEN, gravity_g=g, spread_degc=0.1, seed=6)
    calibration = calibrate(unit(estimator=estimator, thermal=CUBIC, gravity_g=g), data)
    temps = np.linspace(-40.0, 70.0, 111)
    # Readings to an eps of 0.6 V; the cubic fit does not amplify that ten times.
    np.testing.assert_allclose(
        calibration.thermal.constants_at(temps), truth(temps), atol=200 * EPS, rtol=0
    )


def test_gravity_scales_k_alone():
    data = readings(tables_truth, TABLE_TEMPS)
    one = calibrate(unit(), data).thermal.constants_at(20.0)
    half = calibrate(unit(gravity_g=0.5), data).thermal.constants_at(20.0)
    np.testing.assert_array_equal(half[:9], 2.0 * one[:9])
    np.testing.assert_array_equal(half[9:], one[9:])


def test_the_result_is_frozen():
    calibration = calibrate(unit(), readings(tables_truth, TABLE_TEMPS))
    with pytest.raises(FrozenInstanceError):
        calibration.estimator = "other"


# Invariances.


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_rows_does_not_matter(seed):
    data = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=20, spread_degc=0.05, seed=seed % 97)
    data = with_checks(data, cubic_truth(), (30.0,), sd_v=1e-6, count=20)
    rows = list(data.dwells)
    random.Random(seed).shuffle(rows)
    shuffled = calibrate(unit(), MeasurementSet(data.source, tuple(rows)))
    original = calibrate(unit(), data)
    # Check dwells keep the order of the file: their errors sum in another order.
    for c, d in zip(shuffled.candidates, original.candidates, strict=True):
        assert c.held_out_g == pytest.approx(d.held_out_g, rel=1e-12)
    assert_same(
        replace(shuffled, candidates=(), selection_reason=""),
        replace(original, candidates=(), selection_reason=""),
    )


@settings(max_examples=15)
@given(st.integers(-12, 8), st.integers(0, 1000))
def test_scaling_the_readings_scales_the_constants(power, seed):
    """By a power of two every operation rounds alike: equal to the bit."""
    data = readings(cubic_truth(), SEVEN, sd_v=1e-5, spread_degc=0.05, seed=seed)
    scale = 2.0**power
    scaled = tuple(replace(d, voltage_v=d.voltage_v * scale) for d in data.dwells)
    one = calibrate(unit(), data)
    other = calibrate(unit(), MeasurementSet(data.source, scaled))
    assert other.candidates == one.candidates
    np.testing.assert_array_equal(
        other.thermal.curves.coefficients, scale * one.thermal.curves.coefficients
    )
    np.testing.assert_array_equal(other.parameter_covariance, scale**2 * one.parameter_covariance)


def test_temperatures_in_other_degrees_give_the_same_curve():
    """T0 and temperatures shifted together: the curves shift with them."""
    data = readings(cubic_truth(), SEVEN, sd_v=1e-5)
    shifted = tuple(replace(d, temp_degc=d.temp_degc + 8.0) for d in data.dwells)
    one = calibrate(unit(thermal=CUBIC), data)
    other = calibrate(unit(thermal=CUBIC, t0_degc=28.0), MeasurementSet("m.csv", shifted))
    np.testing.assert_array_equal(
        one.thermal.curves.coefficients, other.thermal.curves.coefficients
    )


# Covariance.


def test_recorded_statistics_are_used_and_named():
    data = readings(cubic_truth(), SEVEN, sd_v=2e-6, count=64, seed=2)
    calibration = calibrate(unit(estimator="equation-10", thermal=CUBIC), data)
    # K_xx: two readings of variance 4e-12 V^2, halved difference.
    found = [p.covariance[0, 0] for p in calibration.points]
    np.testing.assert_allclose(found, 2 * 4e-12 / 4, rtol=10 * EPS)
    assert calibration.covariance_source.startswith("the dwells' own statistics, sd^2 / count")


def test_without_statistics_the_residuals_are_pooled_and_named():
    data = readings(cubic_truth(), SEVEN, sd_v=2e-6, seed=2)
    calibration = calibrate(unit(thermal=CUBIC), data)
    assert calibration.covariance_source == (
        "residuals over the positions, pooled over 7 temperatures (14 degrees of freedom an "
        "output): count and deviations are missing in all rows"
    )
    partly = tuple(replace(d, count=5, sd_v=np.ones(3)) if d.row != 9 else d for d in data.dwells)
    calibration = calibrate(unit(thermal=CUBIC), MeasurementSet("m.csv", partly))
    assert calibration.covariance_source.endswith("deviations are missing in 1 row, first row 9")


def test_pooled_covariance_allows_the_errors_that_noise_makes():
    """Without statistics the variance is estimated too: squared errors follow F, not chi-square."""
    draws, total = 250, 0.0
    truth = cubic_truth()
    at = np.array([-35.0, 28.0])
    own = np.array([0, 1, 2, 9])
    for seed in range(draws):
        data = readings(truth, SEVEN, sd_v=3e-6, spread_degc=0.05, seed=1000 + seed)
        fit = calibrate(unit(estimator="least-squares", thermal=CUBIC), data)
        error = (fit.thermal.constants_at(at) - truth(at))[:, own]
        covariance = fit.constants_covariance(at)[:, own[:, None], own]
        total += float(np.einsum("ti,tij,tj->t", error, np.linalg.inv(covariance), error)[0])
    # e^T C^-1 e / 4 ~ F(4, n), n = 2 x 7: its mean and variance; 5 sd of the mean of the draws.
    n = 14
    mean = n / (n - 2)
    variance = 2 * n**2 * (4 + n - 2) / (4 * (n - 2) ** 2 * (n - 4))
    assert abs(total / draws / 4 - mean) < 5.0 * np.sqrt(variance / draws)


def test_scatter_beyond_the_statistics_is_told():
    data = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=10, seed=3)
    tight = tuple(replace(d, sd_v=d.sd_v / 10.0) for d in data.dwells)
    calibration = calibrate(unit(thermal=CUBIC), MeasurementSet("m.csv", tight))
    ratio = float(calibration.covariance_source.split("positions ")[1].split(" times")[0])
    # 42 degrees of freedom: 10 within 5 / sqrt(84) of itself.
    assert abs(ratio - 10.0) < 10.0 * 5.0 / np.sqrt(84.0)


def test_covariance_has_the_shape_of_the_temperatures():
    calibration = calibrate(unit(), readings(cubic_truth(), SEVEN, sd_v=1e-6, count=9))
    assert calibration.constants_covariance(20.0).shape == (12, 12)
    many = calibration.constants_covariance(np.zeros((3, 5)))
    assert many.shape == (3, 5, 12, 12)
    eigenvalues = np.linalg.eigvalsh(many)
    assert eigenvalues.min() > -1e-6 * eigenvalues.max()


def test_interpolating_curves_carry_the_points_own_covariance():
    data = readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-6, count=9)
    calibration = calibrate(unit(thermal=TWO_SEGMENTS), data)
    for point in calibration.points:
        np.testing.assert_allclose(
            calibration.constants_covariance(point.temp_degc),
            point.covariance,
            atol=100 * EPS * point.covariance.max(),
            rtol=0,
        )


# Working range.


def test_the_range_spans_the_dwells():
    data = readings(cubic_truth(), (-39.97, 20.0, 70.04))
    assert calibrate(unit(), data).range_degc == (-40.0, 70.1)
    data = readings(cubic_truth(), (-40.3, 20.0, 70.7))  # not steps of 0.1 in binary
    assert calibrate(unit(), data).range_degc == (-40.3, 70.7)
    assert calibrate(unit(), readings(cubic_truth(), (20.03,))).range_degc == (19.53, 20.53)


def test_a_range_beyond_the_calibrated_temperatures_is_refused():
    data = readings(tables_truth, TABLE_TEMPS)
    assert calibrate(unit(range_degc=(-40.5, 70.5)), data).range_degc == (-40.5, 70.5)
    for wrong in ((-40.51, 70.0), (-40.0, 70.51), (-60.0, 90.0)):
        message = refusal(data, range_degc=wrong)
        assert message.startswith(
            f"units/AT-TEST/unit.toml, [thermal] range_degc: {wrong[0]:g} to {wrong[1]:g} degC; "
            "expected within 0.5 degC of the calibrated temperatures, -40 to 70 degC"
        )


# Refusals pass through, before any fit.


def test_refusals_of_the_parts():
    data = readings(tables_truth, TABLE_TEMPS)
    without = MeasurementSet(data.source, data.dwells[1:])
    assert "TP1 missing at -40 degC" in refusal(without)
    message = refusal(data, thermal=CUBIC)
    assert "order 3 with 3 calibrated temperatures" in message
    assert "highest order possible is 2" in message
    message = refusal(
        data, thermal=ThermalChoice("piecewise-linear", {"knots_degc": (-40.0, 45.0, 50.0)})
    )
    assert "nothing determines the knot" in message
    one = MeasurementSet(data.source, data.dwells[6:12])
    message = refusal(one, thermal=TWO_SEGMENTS)
    assert '"piecewise-linear" with one calibrated temperature (20 degC)' in message


def test_a_singular_unit_is_refused_with_its_rows():
    constants = TABLES[1].copy()
    constants[3:6] = 1.01 * constants[:3]  # no exact copy
    message = refusal(readings(lambda _: constants, (20.0,)))
    assert message.startswith("measurements.csv, rows 2, 3, 4, 5, 6, 7: K at 20 degC")
    assert "outputs Ux and Uy respond alike" in message


def test_exchanged_positions_are_told_before_the_condition_number():
    """Exchanged positions of two axes make K singular: the cause is named, not the effect."""
    data = readings(tables_truth, TABLE_TEMPS)
    other = {"TP1": "TP4", "TP4": "TP1"}
    spoiled = tuple(replace(d, position=other.get(d.position, d.position)) for d in data.dwells)
    message = refusal(MeasurementSet(data.source, spoiled))
    assert "TP1 and TP4 look exchanged at -40, 20, 70 degC" in message


def test_scipy_is_not_loaded():
    modules = "[m for m in sys.modules if 'scipy' in m]"
    code = f"import sys, triaxcal.fitting.tilter.calibrate; print({modules})"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
