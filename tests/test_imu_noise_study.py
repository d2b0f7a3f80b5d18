"""`triaxcal noise` of an IMU at rest: the [noise] that it offers is that of the simulation."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from dynamic_cases import COLUMNS, UNIT_TOML, write_unit
from hand_motion import shaped_flicker
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.noise import MICRO_G
from triaxcal.dynamic.wander import FLOOR


def test_the_section_is_that_of_the_unit(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    n, step_s = 60_000, 0.05
    root = 1 / math.sqrt(step_s)
    rate = 0.12 * math.pi / 180 / 60 * root * rng.standard_normal((n, 3))
    rate = rate + shaped_flicker(rng, n, step_s, 4.0 * DEG_PER_H / FLOOR)
    force = [0.0, 0.0, 9.81] + 50.0 * MICRO_G * root * rng.standard_normal((n, 3))
    force = force + shaped_flicker(rng, n, step_s, 30.0 * MICRO_G / FLOOR)
    time_s = step_s * np.arange(1, n + 1)
    table = np.column_stack([time_s, rate, force, np.full(n, 20.0)])
    folder = write_unit(tmp_path / "IMU-A", table, UNIT_TOML)
    assert COLUMNS[0] == "time_s"
    study = triaxcal.study_noise(folder / "recording.csv", folder / "unit.toml")
    section = tomllib.loads("[noise]" + study.summary.rpartition("[noise]")[2])["noise"]
    # White noise of 60 000 samples in three axes: 0.2 %, and what flicker is taken for it: 5 %.
    assert abs(section["gyro_arw_deg_per_sqrt_h"] / 0.12 - 1) < 0.05
    assert abs(section["accel_vrw_ug_per_sqrt_hz"] / 50.0 - 1) < 0.05
    # 50 min with a corner at N^2/B^2 = 1.4 s: some thousand ordinates below it in three axes.
    assert abs(section["gyro_bias_instability_deg_per_h"] / 4.0 - 1) < 0.2
    assert abs(section["accel_bias_instability_ug"] / 30.0 - 1) < 0.2
    assert "angle random walk N" in study.summary


def test_no_figures_are_offered_of_outputs_that_jump(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    noise = 1e-3 * rng.standard_normal((1600, 6))
    noise[800:830, 1] += 0.012
    time_s = 0.05 * np.arange(1, 1601)
    noise[:, 5] += 9.81
    table = np.column_stack([time_s, noise, 0 * time_s])
    folder = write_unit(tmp_path / "IMU-A", table, UNIT_TOML)
    said = triaxcal.study_noise(folder / "recording.csv", folder / "unit.toml").summary
    assert "gyros: output y jumps by more than 8 standard deviations, 2 in all" in said
    assert said.endswith("no [noise] for unit.toml: outputs jump; cut those parts out")


@pytest.mark.parametrize(
    ("turning_deg_per_s", "level", "words"),
    [
        (30.0, [1.0, 0.0, 0.0], "gravity moves in the unit by"),
        (30.0, [0.0, 0.0, 1.0], "the unit turns at 30 deg/s, first at 40 s"),
    ],
)
def test_a_recording_with_a_turn_is_refused(
    tmp_path: Path, turning_deg_per_s: float, level: list[float], words: str
) -> None:
    """About a level axis gravity shows it, about the vertical the gyros do."""
    rng = np.random.default_rng(5)
    time_s = 0.05 * np.arange(1, 1601)
    turns = (time_s > 40.0) & (time_s < 46.0)
    rate = np.radians(turning_deg_per_s) * turns[:, None] * level
    angle = np.cumsum(rate[:, 0]) * 0.05
    force = 9.81 * np.column_stack([0 * angle, np.sin(angle), np.cos(angle)])
    noise = 1e-3 * rng.standard_normal((len(time_s), 6))
    table = np.column_stack([time_s, rate + noise[:, :3], force + noise[:, 3:], 0 * time_s])
    folder = write_unit(tmp_path / "IMU-A", table, UNIT_TOML)
    with pytest.raises(RefusedError) as refusal:
        triaxcal.study_noise(folder / "recording.csv", folder / "unit.toml")
    assert words in str(refusal.value)
    assert "expected a recording at rest" in str(refusal.value)
