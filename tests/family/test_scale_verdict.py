"""Readings in g or m/s^2 whose scale is far from nominal have not passed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import directions, write_unit

import triaxcal
from triaxcal.cli.main import main
from triaxcal.delivery.verdict import Verdict

K = np.eye(3) + np.array([[0.01, 0.004, -0.003], [0.004, -0.008, 0.002], [-0.003, 0.002, 0.005]])
BIAS = np.array([0.02, -0.03, 0.01])
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])


def unit_of(
    tmp_path: Path, factor: float, unit: str, priors: str = "", turn: np.ndarray | None = None
) -> Path:
    """30 poses, noise 0.3 mg; all readings times `factor`."""
    one_g = {"g": 1.0, "mg": 1000.0, "m/s^2": 9.80665, "count": 16384.0}[unit]
    noise = 3e-4 * np.random.default_rng(3).standard_normal((30, 3))
    own = K if turn is None else K @ turn
    values = factor * one_g * (directions(30, seed=3) @ own.T + BIAS + noise)
    rows = f'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "{unit}"'
    return write_unit(tmp_path / "U", values, f"{rows}\n[priors]\n{priors}", header="a,b,c")


def verdict(folder: Path) -> Verdict:
    return triaxcal.fit(triaxcal.read_unit(folder)).verdict


@pytest.mark.parametrize(
    ("factor", "unit", "told"),
    [
        (0.5, "g", "1 g reads 0.501 g where 1 g is nominal, 5 standard"),
        (0.5, "m/s^2", "1 g reads 4.91 m/s^2 where 9.80665 m/s^2 is nominal, 5 standard"),
        (0.5, "mg", "1 g reads 501 mg where 1000 mg is nominal, 5 standard"),
        (1.5, "g", "1 g reads 1.5 g where 1 g is nominal, 5 standard"),
    ],
)
def test_a_scale_far_from_nominal_has_not_passed(
    tmp_path: Path, factor: float, unit: str, told: str
) -> None:
    found = verdict(unit_of(tmp_path, factor, unit))
    assert found.result == "not shown"
    assert not found.passed
    assert found.words.startswith(f"not shown to be within the limits: {told}")
    assert (
        "deviations of [priors] mean_scale = 0.1 (the default): check unit and full" in found.words
    )


@pytest.mark.parametrize(
    ("factor", "unit", "priors"),
    [
        (1.0, "g", ""),
        (0.75, "g", ""),
        (1.25, "m/s^2", ""),
        (0.5, "g", "mean_scale = 0.3"),
        (0.5, "count", ""),  # no nominal scale is known
    ],
)
def test_a_scale_that_is_not_far_passes(
    tmp_path: Path, factor: float, unit: str, priors: str
) -> None:
    found = verdict(unit_of(tmp_path, factor, unit, priors))
    assert found.passed
    assert found.contradicts == ()


def test_a_turned_sensor_has_its_nominal_scale(tmp_path: Path) -> None:
    found = verdict(unit_of(tmp_path, 1.0, "g", "cross_term_rad = 0.9\nscale_factor = 0.3", TURN))
    assert found.contradicts == ()


def test_all_reports_say_it(tmp_path: Path) -> None:
    folder = unit_of(tmp_path, 0.5, "g")
    done = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "b")])
    assert done.exit_code == 0, done.output
    built = tmp_path / "b" / "U"
    for name in ("passport.json", "verification.json"):
        assert "not shown to be within the limits: 1 g reads 0.501 g" in (built / name).read_text()
    assert "verdict: not shown to be within the limits: 1 g reads" in (
        built / "triax_calib.h"
    ).read_text().replace("\n *  ", "")
    page = (built / "passport.html").read_text()
    assert "the scale contradicts the readings&#39; unit" in page
