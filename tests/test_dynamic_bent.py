"""Bent characteristics: asymmetry and nonlinearity of both triads, against exact motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynamic_judge import data_sheet, judge
from test_dynamic_judge import assert_honest, motion
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.missing import missing_effects
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import AVIATION, draw_truth

BENT = {
    "gyro-asymmetry": {"gyro_asymmetry_ppm": (300.0, -200.0, 150.0)},
    "gyro-nonlinearity": {
        "gyro_even_ppm_per_deg_s": (20.0, -30.0, 10.0),
        "gyro_odd_ppm_per_deg_s": (40.0, -20.0, 30.0),
        "gyro_cubic_ppm_per_deg2_s2": (0.2, 0.1, -0.3),
    },
    "accelerometer-asymmetry": {"accel_asymmetry_ppm": (50.0, -40.0, 30.0)},
    "accelerometer-nonlinearity": {
        "accel_square_mm_per_s2_per_g2": (0.5, -0.3, 0.4),
        "accel_cubic_mm_per_s2_per_g3": (-0.2, 0.3, 0.25),
    },
}


@pytest.mark.parametrize("name", BENT)
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in range(1, 8))]
)
def test_a_bent_characteristic_is_recovered_with_its_sign(name: str, seed: int) -> None:
    truth = replace(draw_truth(AVIATION, seed), **BENT[name])
    verdict = judge(truth, motion(1.5), 50.0, seed, (name,))
    assert_honest(verdict)
    # Where a state is ten deviations from nothing, its sign is certain.
    true = verdict.result.p[21:] - verdict.error[21:]
    clear = np.abs(true) > 10 * verdict.sd[21:]
    assert clear.any()
    assert (np.sign(verdict.result.p[21:]) == np.sign(true))[clear].all()


@pytest.mark.parametrize("name", BENT)
def test_a_bent_characteristic_that_is_off_is_named(name: str) -> None:
    """It alone, though rates of three sizes make all characteristics of a gyro look alike.

    The gyros' are a thirtieth of those above: hundreds of deviations off, the passes do not settle.
    """
    part = 1 / 30 if name.startswith("gyro") else 1.0
    bent = {key: tuple(part * value for value in values) for key, values in BENT[name].items()}
    truth = replace(draw_truth(AVIATION, 9), **bent)
    recording = simulate_imu(truth, motion(1.5), 50.0, 9)
    samples = recording.all()
    recording = replace(recording, pieces=lambda: (samples,))
    result = calibrate_dynamic(recording, data_sheet(truth.noise))
    shown = [effect.name for effect in missing_effects(recording, result) if effect.shown]
    assert shown == [name]
