"""Priors that the poses contradict are named, with what the poses show and what to state."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import directions, write_unit

from triaxcal.cli.main import main
from triaxcal.delivery.fitted import fit_folder
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import read_unit

ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "g"'
CROSS = np.array([[0.0, 0.02, -0.018], [0.02, 0.0, 0.015], [-0.018, 0.015, 0.0]])


def readings(K: FloatArray, bias: FloatArray, count: int = 30) -> FloatArray:
    noise = 3e-4 * np.random.default_rng(3).standard_normal((count, 3))
    result: FloatArray = directions(count, seed=3) @ K.T + bias + noise
    return result


def told(tmp_path: Path, values: FloatArray, priors: str) -> list[str]:
    folder = write_unit(tmp_path / "U", values, f"{ROWS}\n[priors]\n{priors}", header="a,b,c")
    recording = fit_folder(read_unit(folder), folder).calibration.recording
    assert recording is not None
    assert set(recording.contradicted) <= set(recording.findings)
    return [finding for finding in recording.findings if "contradicted" in finding]


@pytest.mark.parametrize(
    ("K", "priors", "shown", "scale"),
    [
        (np.eye(3) + CROSS, "cross_term_rad = 0.001", ("Kxy / K", 0.02), (0.015, 0.022)),
        (np.diag([1.03, 0.98, 0.99]), "scale_factor = 5e-4", ("Kxx / K - 1", 0.03), (0.018, 0.032)),
        (
            1.08 * np.eye(3),
            "mean_scale = 1e-4\nscale_factor = 1e-4",
            ("K / nominal - 1", 0.08),
            (0.05, 0.12),
        ),
    ],
)
def test_a_prior_far_from_the_poses_is_named(
    tmp_path: Path, K: FloatArray, priors: str, shown: tuple[str, float], scale: tuple[float, float]
) -> None:
    name, truth = shown
    key, _, value = priors.splitlines()[0].partition(" = ")
    found = [text for text in told(tmp_path, readings(K, np.zeros(3)), priors) if key in text]
    assert len(found) == 1
    assert found[0].startswith(f"[priors] {key} = {float(value):g} is contradicted by the poses")
    words = re.search(rf"show {re.escape(name)} = (\S+) \+- ([-.e0-9]+)", found[0])
    assert words is not None, found[0]
    assert abs(float(words[1]) - truth) < 3.0 * float(words[2])
    assert float(words[2]) < 1e-3
    stated = re.search(rf"or state {key} = ([-+.e0-9]+)", found[0])
    assert stated is not None
    assert scale[0] < float(stated[1]) < scale[1]


def test_priors_that_hold_are_not_named(tmp_path: Path) -> None:
    assert told(tmp_path, readings(np.eye(3) + 0.3 * CROSS, np.full(3, 0.05)), "") == []


def test_a_zero_far_from_the_prior_is_named(tmp_path: Path) -> None:
    values = readings(np.eye(3), np.array([0.1, -0.05, 0.02]))
    found = told(tmp_path, values, "bias_g = 0.002")
    assert len(found) == 1
    assert "bias_g = 0.002 is contradicted by the poses: 0 g reads about +0.09" in found[0]
    assert "or state bias_g = 0.06" in found[0]


def test_a_refusal_for_the_residuals_names_it(tmp_path: Path) -> None:
    """The prior makes residuals of 20 mg: no pose is to blame."""
    values = readings(np.eye(3) + CROSS, np.zeros(3))
    text = f"{ROWS}\n[priors]\ncross_term_rad = 1e-5"
    folder = write_unit(tmp_path / "U", values, text, header="a,b,c")
    result = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "B")])
    assert result.exit_code == 1
    assert "[priors] cross_term_rad = 1e-05 is contradicted by the poses" in str(result.exception)


def test_it_stands_in_terminal_and_files(tmp_path: Path) -> None:
    text = f"{ROWS}\n[priors]\ncross_term_rad = 5e-4"
    K = np.eye(3) + 0.25 * CROSS
    folder = write_unit(tmp_path / "U", readings(K, np.zeros(3)), text, header="a,b,c")
    result = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "B")])
    said = "[priors] cross_term_rad = 0.0005 is contradicted by the poses"
    assert result.exit_code == 0, result.exception
    assert said in " ".join(result.output.split())
    made = next((tmp_path / "B").rglob("calibration.json"))
    document = json.loads(made.read_text())
    assert any(said in finding for finding in document["recording"]["findings"])
    assert said in (made.parent / "passport.html").read_text()
