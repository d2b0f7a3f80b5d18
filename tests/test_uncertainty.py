"""Sources of uncertainty one by one: against exact formulas, finite differences and Monte Carlo."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import fit_cases
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.readings.measurements import Dwell, MeasurementSet, read_measurements
from triaxcal.simulation.dwells import simulate
from triaxcal.simulation.rig import Rig, rotation
from triaxcal.simulation.truth import Imperfections, Truth, read_truth
from triaxcal.uncertainty.budget import budget
from triaxcal.uncertainty.coverage import (
    coverage_factor,
    effective_dof,
    student_within,
    with_offset,
)
from triaxcal.uncertainty.device_sources import Device
from triaxcal.uncertainty.evaluate import Uncertainty, uncertainty
from triaxcal.uncertainty.heldout import held_out, thermal_error
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance, in_words, weights
from triaxcal.uncertainty.propagation import ROWS, propagation, rows_of
from triaxcal.uncertainty.scatter import scatter
from triaxcal.uncertainty.source import NORMAL, Source
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.uncertainty import StatedUncertainty

UNITS = Path(__file__).parent.parent / "units"
DEVICE = Device(24, (0.75, 0.75, 0.75), 5e-7)
ZERO = StatedUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CUBIC = ThermalChoice("polynomial", {"order": 3})
TEMPS = np.array([-35.0, -5.0, 20.0, 48.0, 66.0])


def sim_unit(stated: StatedUncertainty = ZERO) -> UnitDescription:
    return replace(
        read_unit(UNITS / "AT-SIM"), stated=stated, thermal=CUBIC, estimator="least-squares"
    )


def evaluated(
    unit: UnitDescription, measurements: MeasurementSet, device: Device | None = DEVICE
) -> tuple[Calibration, Uncertainty]:
    calibration = calibrate(unit, measurements)
    return calibration, uncertainty(unit, measurements, calibration, device)


@pytest.fixture(scope="module")
def at_sim() -> tuple[UnitDescription, MeasurementSet, Calibration]:
    unit = read_unit(UNITS / "AT-SIM")
    measurements = read_measurements(UNITS / "AT-SIM" / "measurements.csv", unit)
    return unit, measurements, calibrate(unit, measurements)


# ---- coverage factors ----


def test_student_agrees_with_scipy() -> None:
    for dof in (1, 2, 3, 7, 8, 30, 199, 200, 1000, 10**6):
        # The bisection stops at 1e-17, the expansion's fourth term is below 1e-8 at 200.
        assert coverage_factor(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=2e-8)
    assert student_within(2.0, 5) == pytest.approx(1 - 2 * stats.t.sf(2.0, 5), rel=1e-12)


def test_degrees_of_freedom_are_rounded_down() -> None:
    assert coverage_factor(8.99) == coverage_factor(8.0)
    assert coverage_factor(0.3) == coverage_factor(1.0)
    assert coverage_factor(math.inf) == pytest.approx(1.959963984540054, rel=1e-15)


def test_welch_satterthwaite_of_the_gum_example() -> None:
    # GUM H.1.6: u_c = 32 nm from 25 (18), 9.7 (25.6), 16.6 (50), 1.7 (infinite), 10.2 (2) nm.
    parts = [(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0), (1.7, math.inf)]
    assert effective_dof(parts) == pytest.approx(16.7, abs=1.0)
    assert effective_dof([(3.0, 5.0)]) == pytest.approx(5.0)
    assert effective_dof([]) == math.inf


# ---- propagation ----


def test_noise_is_the_covariance_of_the_fit(
    at_sim: tuple[UnitDescription, MeasurementSet, Calibration],
) -> None:
    unit, measurements, calibration = at_sim
    result = uncertainty(unit, measurements, calibration, None)
    noise = next(s for s in result.sources if s.key == "noise").constants
    assert noise is not None
    expected = calibration.constants_covariance(result.temps_degc)
    found = noise[:, ROWS][:, :, ROWS]
    # Two orders of summation of the same 42 products.
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * expected.max())


def test_held_out_errors_are_those_of_the_selection(
    at_sim: tuple[UnitDescription, MeasurementSet, Calibration],
) -> None:
    unit, measurements, calibration = at_sim
    p = propagation(unit, measurements, calibration, TEMPS)
    errors = held_out(p, scatter(p)).errors_g
    chosen = next(c for c in calibration.candidates if c.chosen)
    assert math.sqrt(np.mean(errors**2)) == pytest.approx(chosen.held_out_g, rel=1e-9)


def test_held_out_operator_is_the_derivative_of_the_errors() -> None:
    unit = sim_unit()
    truth, plan = read_truth(UNITS / "AT-SIM")
    measurements = simulate(unit, truth, replace(plan, readings_per_dwell=4))
    base = propagation(unit, measurements, calibrate(unit, measurements), TEMPS)
    before = held_out(base, scatter(base))
    tilter = [k for k, d in enumerate(measurements.dwells) if d.position.startswith("TP")]
    step = 1e-4  # V, 0.2 mg: the change of N by it is 1e-4 of itself
    for reading, axis in ((0, 0), (9, 2), (23, 1), (41, 0)):
        k = tilter[reading]
        changed = measurements.dwells[k].voltage_v.copy()
        changed[axis] += step
        dwells = list(measurements.dwells)
        dwells[k] = replace(dwells[k], voltage_v=changed)
        moved = MeasurementSet("moved", tuple(dwells))
        p = propagation(unit, moved, calibrate(unit, moved), TEMPS)
        found = (held_out(p, scatter(p)).errors_g - before.errors_g) / step
        # Readings of AT-SIM are in the file's order of positions, TP1 to TP6 at each temperature.
        np.testing.assert_allclose(found, before.operator[:, reading, axis], atol=2e-3)


def test_rotations_are_exact() -> None:
    turned = rotation(np.array([0.0, 0.0, np.pi / 2])) @ np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-15)
    R = rotation(np.array([0.3, -0.2, 0.1]))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)


CASES = {
    "squareness": (
        Imperfections(squareness_sd_arcsec=60.0),
        replace(ZERO, squareness_arcsec=60.0),
    ),
    "repeatability": (
        Imperfections(repeatability_sd_arcsec=60.0),
        replace(ZERO, repeatability_arcsec=60.0),
    ),
    "level": (Imperfections(level_sd_arcsec=60.0), replace(ZERO, level_arcsec=60.0)),
    "gravity": (Imperfections(gravity_sd_m_per_s2=2e-3), replace(ZERO, gravity_m_per_s2=2e-3)),
    "thermometer": (
        Imperfections(thermometer_offset_sd_degc=0.3),
        replace(ZERO, thermometer_degc=0.3),
    ),
    "noise": (Imperfections(), ZERO),
}
RUNS = 300


def drawn(unit: UnitDescription, truth: Truth, seed: int) -> MeasurementSet:
    """TP1 to TP6 at seven temperatures, without codes; the statistics are the true ones."""
    random = np.random.default_rng(seed)
    rig = Rig(truth.imperfections, unit.gravity_g, seed)
    count = 400
    sd = np.full(3, truth.reading_sd_v)
    dwells = []
    for nominal in fit_cases.SEVEN:
        for position in TEST_POSITIONS:
            temp = nominal + 0.05 * random.standard_normal()
            exact = truth.voltage_v(rig.force_g(position), temp)
            noise = sd / np.sqrt(count) * random.standard_normal(3)
            shown = temp + rig.thermometer_offset_degc
            dwells.append(Dwell(len(dwells) + 2, position, shown, exact + noise, count, sd))
    return MeasurementSet("drawn", tuple(dwells))


@pytest.mark.parametrize("key", CASES)
def test_each_source_agrees_with_monte_carlo(key: str) -> None:
    """The rig tilts exactly and shifts temperatures; the propagation is linear."""
    imperfections, stated = CASES[key]
    unit = sim_unit(stated)
    truth = replace(read_truth(UNITS / "AT-SIM")[0], imperfections=imperfections)
    exact = truth.constants.constants_at(TEMPS)
    W = weights(DIRECTIONS[:26])
    N = np.linalg.inv(exact[:, :9].reshape(-1, 3, 3))
    errors, forces = [], []
    for seed in range(RUNS):
        measurements = drawn(unit, truth, seed)
        calibration = calibrate(unit, measurements)
        error = calibration.thermal.constants_at(TEMPS) - exact
        errors.append(error)
        D = -np.einsum("nij,njk->nik", N, rows_of(error)).reshape(-1, 12)
        forces.append(np.einsum("dqa,na->ndq", W, D))
    result = uncertainty(unit, measurements, calibration, None, TEMPS)
    known = [s for s in result.sources if s.key in (key, "noise")]
    constants = np.sum([s.constants for s in known], axis=0)
    expected = np.diagonal(constants, axis1=1, axis2=2)[:, list(ROWS)]
    # The variance of RUNS draws is known to sqrt(2 / RUNS) = 8 %; five times that, for hundreds
    # of values at once.
    limit = 5.0 * math.sqrt(2.0 / RUNS)
    ratio = np.mean(np.array(errors) ** 2, axis=0) / expected
    assert np.abs(ratio - 1.0).max() < limit, ratio
    if key == "thermometer":  # it cancels in use, and D here is at the true temperature
        return
    spread = np.mean(np.array(forces) ** 2, axis=0)
    force = np.sum([s.force for s in known], axis=0)
    analytic = np.einsum("dqa,nab,dqb->ndq", W, force, W)
    floor = 1e-3 * analytic.max()  # quantities that the source does not reach
    assert np.abs((spread + floor) / (analytic + floor) - 1.0).max() < limit


# ---- sizes from the residuals ----


def test_residuals_tell_squareness_from_repeatability() -> None:
    unit = sim_unit()
    truth, plan = read_truth(UNITS / "AT-SIM")
    wrong = Imperfections(squareness_sd_arcsec=15.0, repeatability_sd_arcsec=5.0)
    truth = replace(truth, imperfections=wrong)
    squares, repeats = [], []
    for seed in range(100):
        measurements = simulate(unit, truth, replace(plan, seed=seed, readings_per_dwell=50))
        p = propagation(unit, measurements, calibrate(unit, measurements), TEMPS)
        s = scatter(p)
        squares.append(math.degrees(s.squareness_rad) * 3600.0)
        repeats.append(math.degrees(s.repeatability_rad) * 3600.0)
    # Variances with 6 and 36 degrees of freedom, averaged over 100: 6 % and 2.4 %; four times that.
    assert np.mean(np.square(squares)) == pytest.approx(15.0**2, rel=0.24)
    assert np.mean(np.square(repeats)) == pytest.approx(5.0**2, rel=0.12)


def test_a_squareness_that_noise_explains_is_not_counted() -> None:
    """A perfect tilter: half of the units show none at all, and no more is claimed than is seen."""
    unit, found = sim_unit(replace(ZERO, squareness_arcsec=None)), []
    truth, plan = read_truth(UNITS / "AT-SIM")
    for seed in range(20):
        measurements = simulate(unit, truth, replace(plan, seed=seed, readings_per_dwell=30))
        _, u = evaluated(unit, measurements)
        found.append(next(s for s in u.sources if s.key == "squareness"))
    # S_m has 6 degrees of freedom, S_w 36: F(6, 36) is below 1 in 56 % of units, and 20 draws are
    # all above it once in 10^7.
    none = [s for s in found if s.sd == 0.0]
    assert none
    told = re.fullmatch(r".*; below ([\d.]+) arcsec it is within the noise", none[0].origin)
    assert told
    # v = (20 micro-g)^2 / 30, G = 7: sqrt(1.5 v / G sqrt(1/3)) rad is 0.265 arcsec; v has 39 * 29
    # degrees of freedom, which makes 2 % of it, and is written with two digits.
    assert float(told[1]) == pytest.approx(0.265, rel=0.08)


def test_a_stated_squareness_that_the_residuals_contradict_is_told() -> None:
    unit = sim_unit(replace(ZERO, squareness_arcsec=1.0))
    truth, plan = read_truth(UNITS / "AT-SIM")
    truth = replace(truth, imperfections=Imperfections(squareness_sd_arcsec=30.0))
    measurements = simulate(unit, truth, replace(plan, readings_per_dwell=50))
    (warning,) = evaluated(unit, measurements)[1].warnings
    assert "squareness_arcsec = 1 is stated, but the residuals show" in warning


def test_without_statistics_the_residuals_give_the_noise() -> None:
    unit = fit_cases.unit()
    truth = fit_cases.cubic_truth()
    found = []
    for seed in range(60):
        measurements = fit_cases.readings(truth, fit_cases.SEVEN, sd_v=2e-6, seed=seed)
        s = scatter(propagation(unit, measurements, calibrate(unit, measurements), TEMPS))
        assert not s.recorded
        assert s.noise_dof == 36.0
        found.append(s.variance_v2.mean())
    # 36 degrees of freedom, 60 times: 3 %, four times that.
    assert np.mean(found) == pytest.approx(4e-12, rel=0.12)


# ---- the thermal model ----


def test_a_wrong_thermal_function_shows_in_the_budget() -> None:
    unit = replace(sim_unit(), thermal=ThermalChoice("polynomial", {"order": 2}))
    truth, plan = read_truth(UNITS / "AT-SIM")
    measurements = simulate(unit, truth, replace(plan, readings_per_dwell=50))
    calibration, result = evaluated(unit, measurements)
    p = propagation(unit, measurements, calibration, TEMPS)
    error = thermal_error(p, scatter(p))
    assert error is not None
    exact = truth.constants.constants_at(result.temps_degc)
    found = calibration.thermal.constants_at(result.temps_degc)
    typical = np.sqrt(np.mean((found - exact)[:, 9:] ** 2)) / 0.55
    # Leaving a temperature out doubles or trebles the distance that the curve has to bridge.
    assert typical < error.sd_g < 4.0 * typical
    t, d, c = result.worst_component()
    worst = result.force_budget(c, t, DIRECTIONS[d])
    assert worst.lines[0].source.key == "thermal_model"
    assert "The thermal model gives 100 % of the uncertainty of a_" in worst.verdict


def test_without_held_out_data_the_rival_function_gives_the_size() -> None:
    unit = read_unit(UNITS / "AT-CHERNIAK")
    measurements = read_measurements(UNITS / "AT-CHERNIAK" / "measurements.csv", unit)
    _, result = evaluated(unit, measurements)
    source = next(s for s in result.sources if s.key == "thermal_model")
    assert source.origin.startswith("not known: nothing was held out")
    assert source.sd is not None
    assert source.sd > 1e-4  # two straight lines and a parabola through tables 1 and 2


def test_without_held_out_data_or_rival_it_is_unknown() -> None:
    unit = fit_cases.unit()
    measurements = fit_cases.readings(fit_cases.cubic_truth(), (20.0, 70.0), sd_v=1e-6, count=100)
    _, result = evaluated(unit, measurements)
    b = result.constant_budget(0, result.t0_index)
    assert {line.source.key for line in b.unknown} == {"thermal_model", "exchanged_temperatures"}
    assert all(line.contribution is None and line.source.sd is None for line in b.unknown)
    assert b.lines[0] is b.unknown[0]
    assert "Not in it: the thermal model, which is unknown" in b.verdict


def test_one_temperature_alone_is_evaluated() -> None:
    unit = fit_cases.unit()
    for count in (None, 100):
        measurements = fit_cases.readings(
            fit_cases.cubic_truth(), (20.0,), sd_v=1e-6, count=count, seed=3
        )
        _, result = evaluated(unit, measurements)
        assert np.isfinite(result.constants_u).all()
        assert (result.constants_u > 0.0).all()
        assert (result.force_u > 0.0).all()


# ---- budgets ----


def test_budgets_add_up_and_are_sorted(
    at_sim: tuple[UnitDescription, MeasurementSet, Calibration],
) -> None:
    unit, measurements, calibration = at_sim
    result = uncertainty(unit, measurements, calibration, DEVICE)
    t, d, c = result.worst_component()
    for b, expanded in (
        (result.force_budget(c, t, DIRECTIONS[d]), result.force_u[t, d, c]),
        (result.constant_budget(3, result.t0_index), result.constants_u[result.t0_index, 3]),
    ):
        parts = [line.contribution or 0.0 for line in b.lines]
        assert parts == sorted(parts, reverse=True)
        assert sum(line.share for line in b.lines) == pytest.approx(1.0)
        assert b.combined == pytest.approx(math.sqrt(sum(u * u for u in parts)))
        assert b.expanded == pytest.approx(expanded, rel=1e-9)
        for line in b.lines:
            if line.sensitivity is not None and line.source.sd is not None:
                assert line.sensitivity * line.source.sd == pytest.approx(line.contribution)


def test_the_device_is_in_the_acceleration_only(
    at_sim: tuple[UnitDescription, MeasurementSet, Calibration],
) -> None:
    unit, measurements, calibration = at_sim
    result = uncertainty(unit, measurements, calibration, DEVICE)
    keys = {s.key: s for s in result.sources}
    for key in ("raw_code", "temperature_code", "firmware"):
        assert keys[key].constants is None
        assert keys[key].force is not None
    assert keys["thermometer"].force is None
    b = result.force_budget(0, 0, np.array([1.0, 0.0, 0.0]))
    found = {line.source.key: line.contribution for line in b.lines}
    assert found["firmware"] == pytest.approx((0.75 * 2.0**-24 + 5e-7) / math.sqrt(3.0))
    assert "model_error_max" in keys["firmware"].advice
    coarse = uncertainty(unit, measurements, calibration, replace(DEVICE, output_q=10))
    assert "output_q" in {s.key: s for s in coarse.sources}["firmware"].advice


def test_a_rotation_moves_no_length_and_gravity_scales_it() -> None:
    unit = sim_unit(replace(ZERO, level_arcsec=10.0, gravity_m_per_s2=1e-3))
    truth, plan = read_truth(UNITS / "AT-SIM")
    measurements = simulate(unit, truth, replace(plan, readings_per_dwell=4))
    _, result = evaluated(unit, measurements)
    arcsec = math.pi / 180.0 / 3600.0
    for n in (np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0])):
        length = {line.source.key: line.contribution for line in result.force_budget(3, 3, n).lines}
        assert length["level"] == pytest.approx(0.0, abs=1e-12)
        assert length["gravity"] == pytest.approx(1e-3 / 9.80665 / unit.gravity_g, rel=1e-6)
    along_x = result.force_budget(0, 3, np.array([0.0, 0.0, 1.0]))
    level = next(line.contribution for line in along_x.lines if line.source.key == "level")
    # Tilts about y move x by the angle; 1e-4 for the shift of the dwells' temperatures.
    assert level == pytest.approx(10.0 * arcsec, rel=1e-4)


def test_empty_budget_says_so() -> None:
    source = Source("a", "the source", "V", "", "", 0.0, NORMAL, 1.0)
    assert budget("q", "V", [(source, 0.0)]).verdict == "Nothing that is known contributes."


def test_fast_variances_are_the_quadratic_forms() -> None:
    random = np.random.default_rng(1)
    factor = random.standard_normal((2, 5, 12, 3))
    covariance = factor @ np.swapaxes(factor, -1, -2)
    W = weights(DIRECTIONS)
    expected = np.einsum("dqa,snab,dqb->sndq", W, covariance, W, optimize=True)
    np.testing.assert_allclose(force_variance(covariance, DIRECTIONS), expected, rtol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 0.03, 0.5, 1.0, 2.5, 4.0, 30.0])
def test_an_interval_about_a_known_offset_holds_95_percent(offset: float) -> None:
    """P(|offset + s Z| < q): with s = 1, by the normal distribution of SciPy.

    The table of offsets has steps of 0.05; between them it is linear, to 3e-4 of s.
    """
    q = float(with_offset(np.array(stats.norm.ppf(0.975)), np.array(offset)))
    inside = stats.norm.cdf(q - offset) - stats.norm.cdf(-q - offset)
    assert inside == pytest.approx(0.95, abs=2e-4)


def test_a_budget_adds_a_known_offset_as_it_is() -> None:
    noise = Source("a", "a", "g", "", "", 1.0, NORMAL)
    shift = Source("b", "b", "g", "", "", 10.0, NORMAL, offset=True)
    found = budget("q", "g", [(noise, 1.0), (shift, 10.0)])
    assert found.combined == pytest.approx(math.hypot(1.0, 10.0))
    # Beyond it on one side: the normal quantile of 95 %.
    assert found.expanded == pytest.approx(10.0 + stats.norm.ppf(0.95), abs=1e-4)
    alone = budget("q", "g", [(shift, 10.0)])
    assert alone.expanded == pytest.approx(10.0)


def test_a_direction_has_no_negative_zero() -> None:
    words = in_words(np.array([-0.34, -0.001, -0.94]))
    assert words == "force along (-0.34, +0.00, -0.94)"
