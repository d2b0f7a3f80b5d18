"""From a simulated recording to constants: the truth within what the filter claims."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from dynamic_cases import aviation, changed, held, mems_short, sheet
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.missing import missing_effects
from triaxcal.dynamic.observability import observability
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import three_axes
from triaxcal.simulation.imu_truth import ImuTruth


def errors(result: DynamicResult, truth: ImuTruth) -> np.ndarray:
    """Estimates less the truth of the 21 constants of the base model, SI."""
    lower = np.tril(np.ones((3, 3), dtype=bool))
    exact = np.concatenate(
        [
            1e-3 * np.array(truth.accel_bias_mm_per_s2),
            truth.accel_matrix()[lower],
            np.radians(truth.gyro_bias_deg_per_h) / 3600,
            truth.gyro_matrix().ravel(),
        ]
    )
    return result.p[:21] - exact


def normalised(result: DynamicResult, truth: ImuTruth) -> tuple[float, float]:
    """Largest error in standard deviations, and chi-square of all 21 together."""
    found = errors(result, truth)
    covariance = result.covariance[:21, :21]
    return (
        float(np.abs(found / np.sqrt(np.diag(covariance))).max()),
        float(found @ np.linalg.solve(covariance, found)),
    )


def test_aviation_grade_within_its_own_uncertainty() -> None:
    truth, recording = aviation()
    result = calibrate_dynamic(recording, sheet(truth))
    worst, chi = normalised(result, truth)
    # 21 normal numbers: 4 sd is passed once in 700; chi-square of 21 is beyond 46.8 once in 1000.
    assert worst < 4.0
    assert chi < 46.8
    last = result.passes[-1]
    # The mean of n squares has the deviation sqrt(2/n); the counting of increments is taken as
    # white, which overstates the noise by under 2 %.
    spread = np.sqrt(2 / last.freedom)
    assert 0.98 - 4 * spread < last.chi_square / last.freedom < 1 + 4 * spread
    assert result.heading_rad is not None
    seen = observability(result.layout, result.covariance)
    assert seen.unseen == ()


@cache
def mems_result() -> DynamicResult:
    truth, recording = mems_short()
    return calibrate_dynamic(recording, sheet(truth))


def test_mems_grade_and_pieces_of_any_length() -> None:
    truth, recording = mems_short()
    result = mems_result()
    worst, chi = normalised(result, truth)
    assert worst < 4.0
    assert chi < 46.8
    samples = recording.all()
    chopped = replace(
        recording, pieces=lambda: (samples[k : k + 777] for k in range(0, len(samples), 777))
    )
    again = calibrate_dynamic(chopped, sheet(truth))
    assert np.array_equal(again.p, result.p)  # the same arithmetic in the same order


def test_a_heading_known_to_tens_of_degrees_settles() -> None:
    """Whole steps swing ever wider here: 0.2, 0.3, 0.5, 0.7, 1.05, 1.1 sd, and so on."""
    truth = draw_truth(MEMS, 20240229, ("delay", "g-drift"))
    recording = held(simulate_imu(truth, three_axes(1.5, still_s=12.0), 50.0, 20240229))
    blocks = EXTENSIONS["delay"].blocks + EXTENSIONS["g-drift"].blocks
    result = calibrate_dynamic(recording, sheet(truth), blocks)
    worst, chi = normalised(result, truth)
    assert worst < 4.0
    assert chi < 46.8


def test_a_missing_effect_is_named() -> None:
    """The accelerometers 5 ms late: shown while switched off, found when switched on."""
    truth, recording = mems_short()
    assert not any(e.shown for e in missing_effects(recording, mems_result()))
    samples = recording.all()
    # A quarter of an interval of 20 ms, by the parabola through three samples.
    before, here, after = samples.force[:-2], samples.force[1:-1], samples.force[2:]
    late = samples.force.copy()
    late[1:-1] = here + 0.125 * (before - after) + 0.03125 * (before - 2 * here + after)
    shifted = changed(recording, force=late)
    off = calibrate_dynamic(shifted, sheet(truth))
    effects = {e.name: e for e in missing_effects(shifted, off)}
    assert effects["delay"].shown
    on = calibrate_dynamic(shifted, sheet(truth), EXTENSIONS["delay"].blocks)
    place = on.layout.place("delay").start
    assert abs(on.p[place] - 5e-3) < 4 * on.sd[place]
