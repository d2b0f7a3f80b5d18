"""What the fit with priors was measured to do: on real recordings, in coverage, in cost.

`docs/explanation/priors.md` prints these figures.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from family_cases import write_unit
from test_real_recordings import calibrated, folder_of
from test_recordings import calibrated as calibrated_within_limits

from coverage_devices import shares
from recordings import recording
from triaxcal.fitting.recorded import magnitude, solution
from triaxcal.fitting.recorded.scalar import ScalarData, residual_of
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.types import FloatArray

ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'


@pytest.mark.parametrize("unit", range(5))
def test_mikoffs_units_are_held_out_no_worse_than_by_nine_constants(
    tmp_path: Path, unit: int
) -> None:
    source = recording("mikoff_mpu9150") / f"imu{unit}.log"
    calibration = calibrated(folder_of(tmp_path, source, "mikoff-mpu9150"))
    assert calibration.recording is not None
    held_out = calibration.recording.left_out_length_g or 1.0
    nine = next(c for c in calibration.candidates if c.label == "linear, nine constants")
    assert held_out <= 1.001 * (nine.held_out_g or 0.0)


@pytest.mark.parametrize(
    ("fitted", "tried", "limit_mg"), [("HC", "HC_improved", 4.8), ("HC_improved", "HC", 3.9)]
)
def test_one_day_of_furbrains_instrument_predicts_the_other(
    tmp_path: Path, fitted: str, tried: str, limit_mg: float
) -> None:
    folder = recording("furbrain_sap6")
    poses, others = (
        np.array(json.loads((folder / f"{name}.json").read_text())["grav"])
        for name in (fitted, tried)
    )
    calibration = calibrated_within_limits(write_unit(tmp_path / "U", poses, ROWS, header="a,b,c"))
    linear = force_from_voltage(calibration.thermal.constants_at(20.0)[None], others)
    errors = np.linalg.norm(calibration.terms.force_g(linear), axis=1) - 1.0
    assert np.sqrt(np.mean(errors**2)) * 1e3 <= limit_mg


@pytest.mark.slow
def test_intervals_cover_what_they_say() -> None:
    """500 devices from the priors: six faces and more poses, with and without squares.

    The quantities of a device stand together: 50 devices show a share of 95 % to about 3 %, all
    500 to 1 %. `bench/coverage.py` prints the table.
    """
    kinds = ("scale", "cross", "bias", "component", "length", "C")
    found = np.array(
        [
            [
                shares(range(1000 * count, 1000 * count + 50), count, squares=squares)[k]
                for k in kinds
            ]
            for count in (6, 8, 12, 24, 40)
            for squares in (True, False)
        ]
    )
    assert found.min() > 0.86
    assert ((found.mean(axis=0) > 0.93) & (found.mean(axis=0) < 0.97)).all()


def test_the_cost_of_poses_grows_as_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows whose residuals are evaluated: four times for four times the poses, and some."""
    rows = 0

    def counted(model: Any, gains: int, data: ScalarData, theta: FloatArray) -> Any:
        nonlocal rows
        rows += len(data.reading)
        return residual_of(model, gains, data, theta)

    monkeypatch.setattr(magnitude, "residual_of", counted)
    monkeypatch.setattr(solution, "residual_of", counted)
    needed = []
    for count in (500, 2000):
        rows = 0
        random = np.random.default_rng(0)
        poses = random.standard_normal((count, 3))
        poses *= 9.80665 / np.linalg.norm(poses, axis=1, keepdims=True)
        poses += 3e-3 * random.standard_normal(poses.shape)
        folder = write_unit(tmp_path / f"U{count}", poses, ROWS, header="a,b,c")
        recording_fit = calibrated_within_limits(folder).recording
        needed.append(rows)
        assert recording_fit is not None
        expected = pytest.approx(3e-3 / 9.80665, rel=0.15)
        assert recording_fit.left_out_length_g == expected
    assert needed[1] < 6 * needed[0]
