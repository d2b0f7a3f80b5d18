from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strategies import constants, forces_g, temperatures_degc
from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import read_toml
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.metrological import CONSTANT_NAMES, force_from_voltage, unpack_constants
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, read_measurements
from triaxcal.simulation.dwells import simulate
from triaxcal.simulation.tilts import TILT_DEG, truth_force_g
from triaxcal.simulation.truth import Plan, Truth, read_truth
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.unit.description import UnitDescription, read_unit

UNITS = Path(__file__).parent.parent / "units"
SIM = UNITS / "AT-SIM"
CHERNIAK = UNITS / "AT-CHERNIAK"


@pytest.fixture(scope="module")
def sim() -> tuple[UnitDescription, Truth, Plan]:
    return read_unit(SIM), *read_truth(SIM)


def copy_of(folder: Path, where: Path) -> Path:
    """A unit's folder without its measurements."""
    copy = where / folder.name
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("measurements.csv"))
    return copy


# ---- the shipped units come from their own description ----


@pytest.mark.parametrize("name", ["AT-SIM", "AT-CHERNIAK"])
def test_shipped_measurements_are_reproduced_byte_for_byte(tmp_path: Path, name: str) -> None:
    written = write_simulated_unit(copy_of(UNITS / name, tmp_path))
    assert written == tmp_path / name / "measurements.csv"
    assert written.read_bytes() == (UNITS / name / "measurements.csv").read_bytes(), (
        f"units/{name}/measurements.csv is not what its description gives: if the change is "
        f"meant, run `triaxcal simulate units/{name}`"
    )


def test_equation_10_gives_the_published_tables_to_the_digit() -> None:
    text = (CHERNIAK / "measurements.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines() if line.startswith("TP")]
    U = {(r[0], int(r[1])): [Decimal(cell) for cell in r[2:]] for r in rows}
    tables = read_toml(CHERNIAK / "tables.toml")["constants"]
    assert isinstance(tables, dict)
    temps = tables["temp_degc"]
    assert temps == [-40, 20, 70]
    assert len(U) == 18
    # P1 (10): K from the pairs of an axis; U0 without the axis' own two positions.
    pairs = {"x": ("TP6", "TP5"), "y": ("TP4", "TP2"), "z": ("TP1", "TP3")}
    for k, temp in enumerate(temps):
        for i, axis in enumerate("xyz"):
            for along, (plus, minus) in pairs.items():
                K = (U[plus, temp][i] - U[minus, temp][i]) / 2
                assert tables[f"K{axis}{along}"][k] == K, (axis, along, temp)
            others = [tp for other, pair in pairs.items() if other != axis for tp in pair]
            U0 = sum((U[tp, temp][i] for tp in others), Decimal(0)) / 4
            assert tables[f"U0{axis}"][k] == U0, (axis, temp)
    # The tables themselves, at three places read off the page.
    assert tables["Kxz"][1] == Decimal("0.01639328")
    assert tables["Kzz"][2] == Decimal("-0.54979681")
    assert tables["U0x"][0] == Decimal("0.01181219")


# ---- directions ----


@pytest.mark.parametrize("position", CHECK_POSITIONS)
def test_check_positions_lean_25_deg(position: str) -> None:
    force = truth_force_g(position, 1.001)
    axis = np.array(TEST_POSITIONS[position.replace("CP", "TP")], dtype=float)
    # A unit vector of three rounded products: a few eps of 2.2e-16.
    assert np.linalg.norm(force) == pytest.approx(1.001, rel=1e-15)
    assert math.degrees(math.acos(force @ axis / 1.001)) == pytest.approx(TILT_DEG, rel=1e-13)
    # No azimuth along an axis: all three axes feel at least sin 25 deg * sin 15 deg.
    floor = math.sin(math.radians(TILT_DEG)) * math.sin(math.radians(15.0))
    assert np.min(np.abs(force)) >= floor * 1.001 * (1 - 1e-12)


def test_azimuths_are_spread() -> None:
    azimuths = set()
    for k, position in enumerate(CHECK_POSITIONS, start=1):
        force = truth_force_g(position, 1.0)
        axis = int(np.argmax(np.abs(TEST_POSITIONS[f"TP{k}"])))
        azimuth = math.degrees(math.atan2(force[(axis + 2) % 3], force[(axis + 1) % 3]))
        azimuths.add(round(azimuth % 360.0, 6))
    assert azimuths == {15.0, 75.0, 135.0, 195.0, 255.0, 315.0}


def test_test_positions_are_those_of_the_model() -> None:
    assert truth_force_g("TP2", 0.999).tolist() == [0.0, -0.999, 0.0]


# ---- truth ----


def test_the_truth_has_the_size_of_the_published_tables(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    """At the tables' temperatures within 20 % of the largest change of each constant.

    The cubic term is 15 % of that change at dT = -60 and interpolates elsewhere; 1 % is left for
    the rounding of the curves to three digits, the rest is margin.
    """
    tables = read_toml(CHERNIAK / "tables.toml")["constants"]
    assert isinstance(tables, dict)
    published = np.array([[float(v) for v in tables[name]] for name in CONSTANT_NAMES]).T
    truth = sim[1].constants.constants_at(np.array([-40.0, 20.0, 70.0]))
    change = np.max(np.abs(published - published[1]), axis=0)
    assert np.all(np.abs(truth - published) <= 0.2 * change)
    assert sim[1].constants.curves.order == 3


@given(forces_g(), temperatures_degc())
def test_codes_without_noise_give_the_force_back(force: FloatArray, temp: float) -> None:
    unit = read_unit(SIM)
    truth, _ = read_truth(SIM)
    codes = truth.codes(unit.adc, force, temp)
    constants = truth.constants.constants_at(temp)
    back = force_from_voltage(constants, codes * unit.adc.volts_per_code)
    # Half a code in each output, through the inverse: |N| summed along each row.
    N = np.linalg.inv(unpack_constants(constants)[0])
    bound = np.abs(N).sum(axis=1) * unit.adc.volts_per_code / 2
    assert np.all(np.abs(back - force) <= bound * (1 + 1e-9))


def test_codes_take_arrays_and_saturate(sim: tuple[UnitDescription, Truth, Plan]) -> None:
    unit, truth, _ = sim
    forces = np.array([[0.0, 0.0, 1.0], [-40.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    codes = truth.codes(unit.adc, forces, np.array([20.0, 20.0, 20.0]))
    assert codes.shape == (3, 3)
    assert codes.dtype == np.int64
    assert codes[1, 0] == 2**23 - 1  # K is negative
    assert codes[2, 0] == -(2**23)
    np.testing.assert_array_equal(codes[0], truth.codes(unit.adc, forces[0], 20.0))


# ---- simulated dwells ----


def residuals_v(unit: UnitDescription, truth: Truth, dwell: Dwell) -> tuple[FloatArray, FloatArray]:
    """Mean less truth at the recorded temperature, V, and its standard deviation."""
    force = truth_force_g(dwell.position, unit.gravity_g)
    at = truth.voltage_v(force, dwell.temp_degc)
    slope = (truth.voltage_v(force, dwell.temp_degc + 0.5) - at) * 2.0
    # Rounding to codes adds 1/12 code^2 to the variance of a reading, in either sensor.
    reading = truth.reading_sd_v**2 + unit.adc.volts_per_code**2 / 12
    thermometer = truth.thermometer_sd_degc**2 + unit.temperature_sensor.degc_per_code**2 / 12
    assert dwell.count is not None
    return dwell.voltage_v - at, np.sqrt((reading + slope**2 * thermometer) / dwell.count)


def test_dwell_means_have_the_noise_of_their_count(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    unit, truth, plan = sim
    dwells = simulate(unit, truth, plan).dwells
    normal = np.array([np.divide(*residuals_v(unit, truth, dwell)) for dwell in dwells])
    n = normal.size
    assert n == (7 * 6 + 6 * 6) * 3
    # Sum of n squares of standard normal numbers: n +- sqrt(2 n). Mean: 0 +- 1/sqrt(n). 4 sigma.
    assert abs(np.sum(normal**2) - n) <= 4 * math.sqrt(2 * n)
    assert abs(np.mean(normal)) <= 4 / math.sqrt(n)
    assert np.max(np.abs(normal)) <= 4.5  # 234 normal numbers: 1 in 600 seeds is beyond


def test_the_noise_of_a_mean_is_about_a_micro_g(sim: tuple[UnitDescription, Truth, Plan]) -> None:
    unit, truth, plan = sim
    sd_g = [residuals_v(unit, truth, d)[1] / 0.55 for d in simulate(unit, truth, plan).dwells]
    assert 0.9e-6 <= np.min(sd_g) <= np.max(sd_g) <= 2e-6


def test_recorded_deviations_are_those_of_the_noise(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    unit, truth, plan = sim
    dwells = simulate(unit, truth, plan).dwells
    ratios = np.array([d.sd_v for d in dwells]) / truth.reading_sd_v
    # Relative deviation of a standard deviation of n: 1/sqrt(2 (n - 1)); 4.5 sigma of 234.
    assert np.max(np.abs(ratios - 1)) <= 4.5 / math.sqrt(2 * (plan.readings_per_dwell - 1))


def test_dwell_temperatures_jitter_about_the_plan(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    unit, truth, plan = sim
    dwells = simulate(unit, truth, plan).dwells
    nominals = sorted([*plan.temperatures_degc, *plan.check_temperatures_degc])
    expected = [temp for temp in nominals for _ in range(6)]
    jitter = np.array([d.temp_degc for d in dwells]) - expected
    n = len(jitter)
    sd = truth.dwell_temp_sd_degc
    assert abs(np.sum(jitter**2) / sd**2 - n) <= 4 * math.sqrt(2 * n)
    assert {d.position for d in dwells[:6]} == set(TEST_POSITIONS)
    assert {d.position for d in dwells[6:12]} <= {*TEST_POSITIONS, *CHECK_POSITIONS}


def test_simulation_in_memory_is_what_the_file_says(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    unit, truth, plan = sim
    simulated = simulate(unit, truth, plan)
    written = read_measurements(SIM / "measurements.csv", unit)
    for a, b in zip(simulated.dwells, written.dwells, strict=True):
        assert (a.position, a.temp_degc, a.count) == (b.position, b.temp_degc, b.count)
        np.testing.assert_array_equal(a.voltage_v, b.voltage_v)
        assert a.sd_v is not None
        assert b.sd_v is not None
        np.testing.assert_array_equal(a.sd_v, b.sd_v)


def test_without_noise_the_codes_are_the_exact_ones(
    sim: tuple[UnitDescription, Truth, Plan],
) -> None:
    unit, truth, plan = sim
    still = replace(truth, reading_sd_v=0.0, thermometer_sd_degc=0.0, dwell_temp_sd_degc=0.0)
    for dwell in simulate(unit, still, plan).dwells:
        force = truth_force_g(dwell.position, unit.gravity_g)
        exact = still.codes(unit.adc, force, dwell.temp_degc)
        np.testing.assert_array_equal(dwell.voltage_v, exact * unit.adc.volts_per_code)
        assert dwell.sd_v is not None
        np.testing.assert_array_equal(dwell.sd_v, np.zeros(3))


@given(constants())
def test_equation_10_finds_any_constants_again(expected: FloatArray) -> None:
    """Without noise and thermal curves, to the rounding of the codes."""
    unit = read_unit(SIM)
    curves = PiecewisePolynomial((-200.0, 400.0), (20.0,), expected[None, :, None])
    truth = Truth(ThermalModel(20.0, curves), 0.0, 0.0, 0.0)
    dwells = simulate(unit, truth, Plan(1, 2, (20.0,), ())).dwells
    U = {dwell.position: dwell.voltage_v for dwell in dwells}
    K, U0 = unpack_constants(expected)
    pairs = (("TP6", "TP5"), ("TP4", "TP2"), ("TP1", "TP3"))
    # Each reading is off by half a code at most; means and half differences are off by no more.
    half_code_v = unit.adc.volts_per_code / 2 * (1 + 1e-6)
    for j, (plus, minus) in enumerate(pairs):
        assert np.all(np.abs((U[plus] - U[minus]) / 2 - K[:, j] * unit.gravity_g) <= half_code_v)
        assert np.all(np.abs((U[plus] + U[minus]) / 2 - U0) <= half_code_v)


@settings(max_examples=5)
@given(st.integers(0, 2**63 - 1))
def test_the_seed_decides(seed: int) -> None:
    unit = read_unit(SIM)
    truth, plan = read_truth(SIM)
    small = replace(plan, seed=seed, readings_per_dwell=10, check_temperatures_degc=())
    first, again = (simulate(unit, truth, small).dwells for _ in range(2))
    other = simulate(unit, truth, replace(small, seed=seed ^ 1)).dwells
    assert len(first) == 42
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a.voltage_v, b.voltage_v)
        assert np.any(a.voltage_v != c.voltage_v)


# ---- refusals ----


def test_a_seed_of_the_command_line_replaces_the_file_s(tmp_path: Path) -> None:
    folder = copy_of(SIM, tmp_path)
    text = write_simulated_unit(folder, seed=7).read_text(encoding="utf-8")
    assert text.startswith("# Simulated from truth.toml, seed 7; nothing here was measured.\n")
    assert text != (SIM / "measurements.csv").read_text(encoding="utf-8")
    truth_file = folder / "truth.toml"
    truth_file.write_text(
        re.sub(r"seed = \d+", "seed = 7", truth_file.read_text(encoding="utf-8")), encoding="utf-8"
    )
    assert write_simulated_unit(folder).read_text(encoding="utf-8") == text


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_wrong_seed_is_refused(tmp_path: Path, seed: int) -> None:
    with pytest.raises(RefusedError, match=rf"seed: found {seed}; expected a whole number, 0 to"):
        write_simulated_unit(copy_of(SIM, tmp_path), seed=seed)


def test_a_seed_for_published_constants_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=r"has no random values; omit the seed"):
        write_simulated_unit(copy_of(CHERNIAK, tmp_path), seed=1)


def test_a_unit_that_was_measured_is_not_overwritten(tmp_path: Path) -> None:
    folder = copy_of(SIM, tmp_path)
    (folder / "truth.toml").unlink()
    (folder / "measurements.csv").write_text("measured", encoding="utf-8")
    with pytest.raises(
        RefusedError, match=r"AT-SIM: no truth\.toml and no tables\.toml; expected one of the two"
    ):
        write_simulated_unit(folder)
    assert (folder / "measurements.csv").read_text(encoding="utf-8") == "measured"


def test_truth_and_tables_together_are_refused(tmp_path: Path) -> None:
    folder = copy_of(SIM, tmp_path)
    shutil.copy(CHERNIAK / "tables.toml", folder)
    with pytest.raises(RefusedError, match=r"both truth\.toml and tables\.toml"):
        write_simulated_unit(folder)


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("truth.toml", "format = 1", "format = 2", "truth.toml, format: found 2; expected 1"),
        ("truth.toml", "Kxy = [", "Kyx_ = [", "missing: [curves] Kxy; unknown: [curves] Kyx_"),
        ("truth.toml", "-1.59e-07, ", "", "[curves] Kxx: found [-0.550609, -0.00000930, 5.5E-10]"),
        ("truth.toml", "1.1e-05", "-1.1e-05", "[noise] reading_sd_v: found -0.000011; expected a"),
        ("truth.toml", "= 400", "= 1", "[plan] readings_per_dwell: found 1; expected a whole num"),
        ("truth.toml", "[-40, -20, 0,", "[-20, -40, 0,", "[plan] temperatures_degc: found [-20, "),
        ("truth.toml", "-0.550609", "-5.50609", "TP5 at -40 degC: a reading saturates the ADC"),
        ("unit.toml", "bits = 24", "bits = 4", "[adc] bits: found 4; expected a whole number"),
    ],
)
def test_a_wrong_truth_is_refused(
    tmp_path: Path, file: str, old: str, new: str, expected: str
) -> None:
    folder = copy_of(SIM, tmp_path)
    text = (folder / file).read_text(encoding="utf-8")
    assert text.count(old) == 1
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RefusedError) as caught:
        write_simulated_unit(folder)
    assert expected in str(caught.value)
    assert not (folder / "measurements.csv").exists()


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("tables.toml", "-0.55140269]", "]", "[constants] Kxx: found [-0.55074263, -0.55060863];"),
        ("unit.toml", "9.80665", "9.81", "local_gravity_m_per_s2: 1.0003416 g; expected 9.80665"),
    ],
)
def test_wrong_tables_are_refused(
    tmp_path: Path, file: str, old: str, new: str, expected: str
) -> None:
    folder = copy_of(CHERNIAK, tmp_path)
    text = (folder / file).read_text(encoding="utf-8")
    assert text.count(old) == 1
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RefusedError) as caught:
        write_simulated_unit(folder)
    assert expected in str(caught.value)
