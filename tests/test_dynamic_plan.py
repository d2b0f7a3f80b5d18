"""What a planned motion lets see is what its recording then shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynamic_cases import UNIT_TOML
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.design.imu import plan_unit
from triaxcal.design.imudemands import ImuPlan, plan_demands, reach
from triaxcal.design.imuprogrammes import programmes_of
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.shares import variance_shares
from triaxcal.dynamic.unit import DynamicUnit, calibrate_unit
from triaxcal.report.imuplan import plan_summary
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
    Without noise a rest of 3.2 s may be longer by a window of 0.1 s at each end: 3.1 %.
    """
    folder = unit(tmp_path)
    planned = plan_unit(folder, lambda _step, _part: None)
    assert not (folder / "recording.csv").exists()
    write_simulated_recording(folder)
    recorded = calibrate_unit(folder)
    np.testing.assert_allclose(planned.result.sd, recorded.result.sd, rtol=0.031)
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


DEMANDS = """
[limits]
gyro_scale_sd_ppm = {scale}
accel_bias_sd_mm_per_s2 = {bias}
"""


def with_demands(folder: Path, scale: float, bias: float) -> Path:
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    text += DEMANDS.format(scale=scale, bias=bias)
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    return folder


def sds(done: DynamicUnit, block: str, unit_name: str) -> list[float]:
    layout = done.result.layout
    place = layout.place(block)
    return [
        float(done.result.sd[i]) / layout.states[i].per_unit
        for i in range(place.start, place.stop)
        if layout.states[i].unit == unit_name
    ]


def test_more_motion_is_found_that_meets_a_demand(tmp_path: Path) -> None:
    """Two thirds of what the moves give once: met with so much more, and not with half of that."""
    folder = unit(tmp_path)
    once = plan_unit(folder, lambda _step, _part: None)
    scale = max(sds(once, "gyro-matrix", "ppm")) * 2 / 3
    with_demands(folder, scale, 100.0)
    plan = plan_demands(plan_unit(folder, lambda _step, _part: None), lambda _step, _part: None)
    first, second = plan.demands
    assert (first.key, first.met) == ("gyro_scale_sd_ppm", False)
    assert (second.key, second.met) == ("accel_bias_sd_mm_per_s2", True)
    own = plan.reached[0]
    assert own.left is None
    times = int(own.words.split()[2])
    truth = TRUTH.replace(
        "moves = [", "moves = [" + "[360, 60, 3], [-450, 45, 3], [270, 30, 3], " * (times - 1)
    )
    (folder / "imu_truth.toml").write_text(truth, encoding="utf-8")
    enough = plan_unit(folder, lambda _step, _part: None)
    assert scale * 0.5 < max(sds(enough, "gyro-matrix", "ppm")) <= scale


def test_shares_of_the_variance_are_those_of_the_sources(tmp_path: Path) -> None:
    """They add up to one (Euler), and predict what half of the gyros' noise variance would give.

    A variance is a concave function of a source's, so that it lies below its tangent: it falls by
    at least half of the share. The share is a difference over 10 %, which is off by less than a
    tenth of it. Nor can it fall below a half.
    """
    done = plan_unit(unit(tmp_path), lambda _step, _part: None)
    assert done.recording is not None
    shares = variance_shares(done.recording, done.result)
    np.testing.assert_allclose(sum(shares.values()), 1.0, atol=0.05)
    gyro = shares["gyro noise"]
    assert gyro.min() < 0.1
    assert gyro.max() > 0.3
    noise = done.result.noise
    half = replace(noise, gyro_arw_deg_per_sqrt_h=noise.gyro_arw_deg_per_sqrt_h / 2**0.5)
    left = (calibrate_dynamic(done.recording, half).sd / done.result.sd) ** 2
    assert np.all(left < 1 - 0.9 * gyro / 2 + 1e-6)
    assert np.all(left > 0.5 - 1e-6)


def test_a_plan_without_a_motion_takes_the_usual_ones(tmp_path: Path) -> None:
    folder = with_demands(unit(tmp_path), 100.0, 1.0)
    (folder / "imu_truth.toml").unlink()
    told = CliRunner().invoke(main, ["dynamic", str(folder), "--plan"], catch_exceptions=False)
    assert told.exit_code == 0
    for words in (
        "motion          on a table, 4 min about each axis",
        "gyro_scale_sd_ppm = 100: Theta",
        "  on a table: 2 min about each axis, ",
        "accel_bias_sd_mm_per_s2 = 1: df0_",
        "variance from ",
        "  by hand: ",
    ):
        assert words in told.output
    assert not (folder / "recording.csv").exists()


def test_what_no_motion_meets_is_said(tmp_path: Path) -> None:
    """With the constant, its limit, and what limits it, at the programme's end."""
    folder = with_demands(unit(tmp_path), 1e-3, 1.0)
    done = plan_unit(folder, lambda _step, _part: None)
    programme = replace(programmes_of(done.unit)[0], most=2.0)
    found = reach(done, programme, lambda _step, _part: None)
    assert found.words == "its moves 2 times"
    assert found.left is not None
    assert (found.left.key, found.left.met) == ("gyro_scale_sd_ppm", False)
    assert found.left.sources[0][1] > 0.1
    said = plan_summary(ImuPlan(done, (found.left,), (found,)))
    assert "gyro_scale_sd_ppm = 0.001: Theta" in said
    assert "NOT MET" in said
    assert "[motion] of imu_truth.toml: its moves 2 times, " in said
    assert " min in all: not enough; " in said
