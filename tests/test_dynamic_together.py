"""Effects that act on each other, without noise: what is left is the equations' own error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynamic_cases import aviation, changed, held, perfect, sheet
from dynamic_judge import data_sheet, judge
from test_dynamic_judge import ALL, CENTRES, LINEAR, assert_honest, motion
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.channels import steady
from triaxcal.dynamic.missing import missing_effects
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.poses import static_poses
from triaxcal.dynamic.recording import INCREMENT, INSTANT, ImuRecording
from triaxcal.dynamic.survey import survey
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import AVIATION, draw_truth
from triaxcal.simulation.imu_motion import three_axes

MINUTES = 1.5
LIMIT = 1.0 / np.sqrt(40.0 / MINUTES)
"""One standard deviation of 40 min an axis; it falls with the root of the length at least."""


@pytest.mark.parametrize("convention", [INCREMENT, INSTANT])
def test_a_delay_beside_lever_arms_leaves_no_bias(convention: str) -> None:
    """What the lever arms make the accelerometers feel is late as well.

    With the rate of an interval's middle for that half an interval later, instants at 50 Hz put the
    gyros' scale factors 1.7 sd off, and the positions 7; now the positions 1.04 there.
    """
    truth = perfect(draw_truth(AVIATION, 6, ("delay", "accel-positions")))
    truth = replace(truth, rate_convention=convention, force_convention=convention)
    recorded = three_axes(MINUTES, still_s=30.0, centre_mm=CENTRES)
    blocks = ("delay", "lever-arm", "accelerometer-positions")
    verdict = judge(truth, recorded, 100.0, 6, blocks, noise=AVIATION.noise)
    assert np.abs(verdict.z).max() < LIMIT
    # Without noise the innovations are the equations' error: 6e-3 without the lever arms' delay.
    last = verdict.result.passes[-1]
    assert last.chi_square < 1e-3 * last.freedom


@pytest.mark.parametrize(("convention", "rate_hz"), [(INCREMENT, 200.0), (INSTANT, 50.0)])
def test_all_together_leave_no_bias(convention: str, rate_hz: float) -> None:
    """All 85 states. At 200 Hz a table creeping to a stop once cost 8 sd of both delays."""
    truth = perfect(draw_truth(AVIATION, 6, LINEAR))
    truth = replace(truth, rate_convention=convention, force_convention=convention)
    verdict = judge(truth, motion(MINUTES, "all"), rate_hz, 6, ALL, noise=AVIATION.noise)
    assert np.abs(verdict.z).max() < LIMIT
    last = verdict.result.passes[-1]
    assert last.chi_square < 1e-3 * last.freedom


def test_all_together_settle_with_noise() -> None:
    """Counts of 0.1", coarser than the noise: a table's even turn is no gyro that clips.

    Taken for clips, its turns cut the recording, and the heading stayed unknown for ten passes.
    """
    truth = draw_truth(AVIATION, 1, LINEAR)
    verdict = judge(truth, motion(3.0, "all"), 200.0, 1, ALL)
    assert verdict.result.survey.findings == ()
    assert len(verdict.result.survey.sections) == 1
    assert_honest(verdict)


@pytest.mark.parametrize("seed", [2, 4])
def test_rests_on_a_table_are_of_gravity_alone(seed: int) -> None:
    """They hardly see some constants. Their solution is no worse than none: 150 m/s^2 once."""
    truth = draw_truth(AVIATION, seed, LINEAR)
    recording = held(simulate_imu(truth, motion(5.0, "all"), 50.0, seed))
    found = survey(recording)
    static = static_poses(recording, found, data_sheet(truth.noise))
    force, gravity = np.array([rest.force for rest in found.rests]), recording.gravity_m_per_s2
    known = dict(zip(static.names, static.p, strict=True))
    df0 = np.array([known[f"df0_{i}"] for i in (1, 2, 3)])
    matrix = np.array([[known.get(f"Gamma{i}{j}", 0.0) for j in (1, 2, 3)] for i in (1, 2, 3)])
    corrected = np.linalg.solve(np.eye(3) + matrix, (force - df0).T).T
    without = np.linalg.norm(np.linalg.norm(force, axis=1) - gravity)
    assert np.linalg.norm(np.linalg.norm(corrected, axis=1) - gravity) < without
    assert not static.determined
    assert static.left_out == ()


@pytest.mark.parametrize("effect", ["", "all"])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0])
def test_an_even_turn_is_no_clip(effect: str, rate_hz: float) -> None:
    """On a rough table and on a precise one: steps of the rate there are counts."""
    truth = draw_truth(AVIATION, 16, LINEAR)
    recording = held(simulate_imu(truth, motion(1.5, effect), rate_hz, 16))
    assert survey(recording).findings == ()


def test_a_table_that_creeps_does_not_rest() -> None:
    """30 readings of 1" in a block: a drift by 3 deviations of two halves' difference, 1.1"."""
    arcsec = np.pi / 648000
    angle = np.zeros((6, 30))
    angle[3] = np.linspace(0.0, 2.4 * arcsec, 30)  # its halves differ by 1.24"
    assert steady(angle, arcsec).tolist() == [True, True, False, False, False, True]
    assert steady(angle * 0.8, arcsec).all()


def test_an_angle_within_a_circle_is_as_good_as_one_that_counts_on() -> None:
    """0 and 360 deg are one place; their mean is not. A table that rests at 0 reads both."""
    truth = draw_truth(AVIATION, 6, ("mount-elasticity",))
    recording = held(simulate_imu(truth, motion(MINUTES, "mount-elasticity"), 50.0, 6))
    angle = recording.all().table_angle_rad
    assert angle is not None
    circle = angle % (2 * np.pi)
    assert (np.abs(np.diff(circle)) > 6).sum() > 100
    blocks = EXTENSIONS["table-angles"].blocks + EXTENSIONS["mount-elasticity"].blocks
    counted, wrapped = (
        calibrate_dynamic(changed(recording, table_angle_rad=a), data_sheet(truth.noise), blocks)
        for a in (angle, circle)
    )
    # Rounding of angles of some hundred radians: 1e-13; a thousandth of a deviation is 1e-9.
    assert np.abs((wrapped.p - counted.p) / counted.sd).max() < 1e-3


def shown(recording: ImuRecording, noise: DataSheet) -> dict[str, str]:
    """Hints beside the effects that show, by name."""
    result = calibrate_dynamic(recording, noise)
    return {e.name: e.hint for e in missing_effects(recording, result) if e.shown}


def test_forces_of_reversed_sign_are_diagnosed_where_the_gyros_see_the_earth() -> None:
    truth, recording = aviation()
    force = recording.all().force
    hints = shown(changed(recording, force=-force), sheet(truth))
    assert hints["g-drift"] == (
        "the Earth turns the other way: check the sign of the forces (at rest the axis that points "
        "up reads +g) and of latitude_deg (north is positive)"
    )


def test_forces_a_sample_late_are_diagnosed() -> None:
    truth, recording = aviation()
    force = np.roll(recording.all().force, 1, axis=0)
    hints = shown(changed(recording, force=force), sheet(truth))
    assert hints["delay"].startswith("+1.00 samples: check rate_samples and force_samples")


def test_what_is_right_gives_no_hint() -> None:
    truth, recording = aviation()
    assert shown(recording, sheet(truth)) == {}
