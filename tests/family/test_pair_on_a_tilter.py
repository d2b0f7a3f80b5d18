"""A tilter's unit with cross-coupling: what the pair says is in choice, acceptance and errors."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.fitting.pair.cross_coupling import fit_pair, pair_terms, stated_pair, terms_of_pair
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MEASUREMENTS_FILE, read_measurements, write_measurements
from triaxcal.readings.measurements_csv import DEVIATIONS, READINGS
from triaxcal.report.passport.content import Passport, passport
from triaxcal.simulation.dwells import simulate_codes
from triaxcal.simulation.truth import Truth, read_truth
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance
from triaxcal.unit.description import read_unit

AT_SIM = Path(__file__).parent.parent.parent / "units" / "AT-SIM"
PAIR = '\n[quadratic]\ncross_coupling = "pair.csv"\naxes = ["x", "y"]\n'
COLUMNS = ("position", "temp_code", *READINGS["code"], "count", *DEVIATIONS["code"])


@dataclass(frozen=True)
class Coupled(Truth):
    """A truth whose x reads kip a_x a_y more, and whose y as much less."""

    kip: float = 0.0

    def voltage_v(self, force_g: FloatArray, temp_degc: FloatArray | float) -> FloatArray:
        product = self.kip * force_g[..., 0] * force_g[..., 1]
        seen = force_g + np.stack([product, -product, 0.0 * product], axis=-1)
        return super().voltage_v(seen, temp_degc)


def write_pair(folder: Path, kip: float, sd_g: float = 0.0, seed: int = 4) -> None:
    """28 positions by exact sums, with noise of the readings."""
    theta = 5.0 + 13.0 * np.arange(28)
    a, b = -np.cos(np.radians(theta)), np.sin(np.radians(theta))
    noise = sd_g * np.random.default_rng(seed).standard_normal((28, 2))
    readings = np.stack([a + kip * a * b, b - kip * a * b], axis=1) + noise
    lines = [f"{t:g},{x:.12f},{y:.12f}" for t, (x, y) in zip(theta, readings, strict=True)]
    (folder / "pair.csv").write_text("theta_deg,a_g,b_g\n" + "\n".join(lines) + "\n")


def coupled_unit(folder: Path, kip: float) -> Path:
    """AT-SIM with a coupling, and a pair that shows it."""
    folder.mkdir()
    text = (AT_SIM / "unit.toml").read_text()
    (folder / "unit.toml").write_text(text + PAIR)
    write_pair(folder, kip)
    truth, plan = read_truth(AT_SIM)
    dwells = simulate_codes(read_unit(AT_SIM), Coupled(**vars(truth), kip=kip), plan)
    rows = [(d.position, d.temp_code, *d.mean_code, d.count, *d.sd_code) for d in dwells]
    write_measurements(folder / MEASUREMENTS_FILE, COLUMNS, rows)
    return folder


def check_errors_of_the_c(delivery: Delivery) -> float:
    """Largest | |a| - g | of the compiled C at the check dwells, g."""
    own = next(m for m in delivery.methods if m.method.name == delivery.unit.method)
    return max(abs(r.error_g) for r in own.residuals if r.dwell.position.startswith("CP"))


@pytest.fixture(scope="module")
def plain() -> Passport:
    return passport(deliver(AT_SIM), {})


@pytest.mark.parametrize("kip", [6e-4, 4e-3])
def test_the_choice_sees_what_the_pair_takes_off(
    plain: Passport, tmp_path: Path, kip: float
) -> None:
    """Held-out errors, shown error and u(|a|) are those of AT-SIM without a coupling.

    Without the products the held-out errors are 50 micro-g at 6e-4, and 4e-3 is refused.
    """
    delivery = deliver(coupled_unit(tmp_path / "U", kip))
    made = passport(delivery, {})
    Q = delivery.calibration.terms.quadratic_per_g
    expected = terms_of_pair(kip, kip, (0, 1)).quadratic_per_g
    assert Q is not None
    assert expected is not None
    np.testing.assert_allclose(Q, expected, atol=8 * kip**2)
    # Of second order in the coupling: kip^2 of the product of 1/2 and less, in two axes.
    second = kip**2
    for found, own in zip(
        delivery.calibration.candidates, plain.delivery.calibration.candidates, strict=True
    ):
        assert found.label == own.label
        assert found.held_out_g == pytest.approx(own.held_out_g, abs=second)
    assert check_errors_of_the_c(delivery) < check_errors_of_the_c(plain.delivery) + second + 1e-6
    shown = max(abs(c.error_g) for c in delivery.calibration.check_dwells)
    assert shown == pytest.approx(check_errors_of_the_c(delivery), abs=2e-6)
    assert made.length_budget.expanded < plain.length_budget.expanded + 2.0 * second


def test_a_pair_of_noise_is_told_and_is_in_the_uncertainty(plain: Passport, tmp_path: Path) -> None:
    """AT-SIM has no coupling: what the pair's noise adds lies within the stated interval."""
    within = []
    for seed in range(3):
        folder = tmp_path / str(seed) / "U"
        shutil.copytree(AT_SIM, folder)
        (folder / "unit.toml").write_text((AT_SIM / "unit.toml").read_text() + PAIR)
        write_pair(folder, 0.0, sd_g=1e-3, seed=seed)
        unit = read_unit(folder)
        pair = stated_pair(unit, folder)
        assert pair is not None
        measurements = read_measurements(folder / MEASUREMENTS_FILE, unit)
        calibration = calibrate(unit, measurements, pair)
        assert calibration.pair is pair
        u = uncertainty(unit, measurements, calibration, None)
        (source,) = (s for s in u.sources if s.key == "quadratic_terms")
        assert source.sd == pytest.approx(np.sqrt(pair.covariance.max()), rel=1e-12)
        temp, direction = u.worst_length()
        assert u.force_u[temp, direction, 3] > 5.0 * plain.length_budget.expanded
        assert (
            u.force_budget(3, temp, DIRECTIONS[direction]).lines[0].source.key == "quadratic_terms"
        )
        error = np.einsum("dk,dk->d", DIRECTIONS, products(DIRECTIONS) @ pair.quadratic.T)
        within.append(np.abs(error) <= u.force_u[u.t0_index, :, 3])
        kip = np.abs(pair.quadratic[[0, 1], 3])
        small = kip < 2.0 * np.sqrt(np.diag(pair.covariance)[[3, 9]])
        told = " ".join(calibration.findings)
        assert ("not significant" in told) == small.any()
        assert ("leave [quadratic] cross_coupling out" in told) == small.all()
    assert np.mean(within) > 0.9


def test_the_pairs_interval_holds_the_coupling() -> None:
    """Scatter of Q over 300 pairs against its covariance; 300 draws know a variance to 0.08."""
    theta = np.radians(5.0 + 13.0 * np.arange(28))
    a, b = -np.cos(theta), np.sin(theta)
    found, stated = [], []
    for seed in range(300):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal((2, 28))
        pair = pair_terms(
            "pair.csv", fit_pair("pair.csv", theta, a + noise[0], b + noise[1], 1.0), (0, 1)
        )
        found.append(products(DIRECTIONS) @ pair.quadratic.T)
        force = np.zeros((30, 30))
        at = np.array([10 * i + 4 + k for i in range(3) for k in range(6)])
        force[at[:, None], at] = pair.covariance
        stated.append(force_variance(force, DIRECTIONS))
    length = np.einsum("sdk,dk->sd", np.array(found), DIRECTIONS)
    seen = np.mean(np.square(np.concatenate([found, length[..., None]], axis=-1)), axis=0)
    said = np.mean(stated, axis=0)
    visible = said > 1e-3 * said.max()
    assert np.abs(seen[visible] / said[visible] - 1.0).max() < 5.0 * np.sqrt(2.0 / 300)
    assert np.abs(seen[~visible]).max() < 2e-3 * said.max()


@pytest.mark.long
def test_the_pairs_coupling_in_a_test_report(tmp_path: Path) -> None:
    """Kip of 150 micro-g/g^2, shaken at 45 degrees to x and y: half of it times 0.64 g^2."""
    kip = 150e-6
    folder = coupled_unit(tmp_path / "AT-PAIR", kip)
    write_pair(folder, kip, sd_g=1e-6)
    shaken = "\n[vibration.a]\ndirection = [1, 1, 0]\ngrms = 0.8\n"
    (folder / "unit.toml").write_text((folder / "unit.toml").read_text() + shaken)
    report = triaxcal.make_test_report(triaxcal.read_unit(folder)).result
    for axis, sign in (("x", 1.0), ("y", -1.0)):
        assert report.of("cross_coupling", axis).covers(sign * kip * 1e6)
        assert report.of("vibration_linear", axis).covers(sign * kip * 1e6 * 0.64 / 2.0)
        found = report.of("vibration_c", axis).value
        assert found is not None
        assert report.of("vibration_compensated", axis).covers(found)
        assert abs(found) < 2.0
    assert not any(f.axis == "z" for f in report.chapters[-1].figures)
