"""`triaxcal noise` of an IMU at rest: the [noise] that it offers is that of the simulation."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np

import triaxcal
from dynamic_cases import COLUMNS, UNIT_TOML, write_unit
from hand_motion import shaped_flicker
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
