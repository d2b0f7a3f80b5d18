"""What a planned motion lets see is what its recording then shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynamic_cases import UNIT_TOML
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.design.imu import plan_unit
from triaxcal.dynamic.unit import calibrate_unit
from triaxcal.simulation.imu_unit import planned_motion, write_simulated_recording

TRUTH = """\
format = 1
[unit]
grade = "aviation"
seed = 3
[motion]
rate_hz = 50
moves = [[360, 60, 3], [-450, 45, 3], [270, 30, 3]]
still_s = 12
table = "rough"
temperature = "constant"
"""


def unit(tmp_path: Path, truth: str = TRUTH) -> Path:
    folder = tmp_path / "IMU-P"
    folder.mkdir()
    text = UNIT_TOML.replace("instant", "increment")
    for old, new in (
        ('"gx", "gy", "gz"', ", ".join(f'"gyro_{axis}_arcsec"' for axis in "xyz")),
        ('"ax", "ay", "az"', ", ".join(f'"accel_{axis}_mm_per_s"' for axis in "xyz")),
        ('"rad/s"', '"arcsec"'),
        ('"m/s^2"', '"mm/s"'),
        ("sqrt_h = 0.3", "sqrt_h = 0.002"),
        ("sqrt_hz = 100", "sqrt_hz = 10"),
        ("accel_lsb = 10", "accel_lsb = 0.01"),
    ):
        assert old in text
        text = text.replace(old, new)
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    (folder / "imu_truth.toml").write_text(truth, encoding="utf-8")
    return folder


def test_a_plan_tells_the_deviations_of_its_recording(tmp_path: Path) -> None:
    """The same but for what the unit's errors change in the rows, and the noise in the heading.

    The errors are below 0.1 %. The heading is known to 0.004 rad and better: no row changes by 2 %.
    """
    folder = unit(tmp_path)
    planned = plan_unit(folder, lambda _step, _part: None)
    assert not (folder / "recording.csv").exists()
    write_simulated_recording(folder)
    recorded = calibrate_unit(folder)
    np.testing.assert_allclose(planned.result.sd, recorded.result.sd, rtol=0.02)
    told = CliRunner().invoke(main, ["dynamic", str(folder), "--plan"])
    assert told.exit_code == 0
    assert "expected standard deviations from a recording of this motion" in told.output


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[-450, 45, 3]", "[-20, 45, 3]", "each angle reaching its rate in 1 s"),
        ("[-450, 45, 3]", "[-450, 0, 3]", "a list of [angle in deg, rate in deg/s, stop in s]"),
        ("still_s", "minutes_per_axis = 4\nstill_s", "both given; expected one of them"),
    ],
)
def test_a_plan_that_cannot_be(tmp_path: Path, old: str, new: str, words: str) -> None:
    folder = unit(tmp_path, TRUTH.replace(old, new))
    with pytest.raises(RefusedError) as refusal:
        planned_motion(folder)
    assert words in str(refusal.value)
    assert "[motion] moves" in str(refusal.value)
    assert "\n" not in str(refusal.value)
