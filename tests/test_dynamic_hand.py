"""A unit turned by hand from rest to rest: the rests are believed, the turns are the gyros'."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from dynamic_cases import changed, held, mems_short, recording_of
from hand_cases import Hand, hand_short, record, stated
from recordings import FOLDER, recording
from test_dynamic_calibrate import errors
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import Survey, survey
from triaxcal.evidence.chance import earth
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting, Move

CASES = FOLDER.parent / "cases" / "imu"
TOTAL = (0.005, 0.995)
"""Of chi-square: the 99 % limits."""


def assert_consistent(results: list[DynamicResult], truths: list) -> None:
    """Errors of 21 constants each are what their covariance says.

    The total within the 99 % limits; the number beyond 3 sd, 0.27 % of all, below what it passes
    once in a thousand.
    """
    total, beyond = 0.0, 0
    for result, truth in zip(results, truths, strict=True):
        error, covariance = errors(result, truth), result.covariance[:21, :21]
        total += float(error @ np.linalg.solve(covariance, error))
        beyond += int((np.abs(error) > 3 * result.sd[:21]).sum())
    count = 21 * len(results)
    low, high = stats.chi2.ppf(TOTAL, count)
    assert low < total < high, (total, count)
    assert beyond <= stats.binom.isf(1e-3, count, 2 * stats.norm.sf(3))


@pytest.mark.parametrize(
    ("grade", "seeds", "rate_hz"),
    [
        ("mems", 3, 100.0),
        ("aviation", 2, 200.0),
        pytest.param("mems", 40, 100.0, marks=pytest.mark.slow),
        pytest.param("aviation", 40, 200.0, marks=pytest.mark.slow),
    ],
)
def test_short_poses_by_hand_give_both_triads(grade: str, seeds: int, rate_hz: float) -> None:
    """37 poses of 1 to 4 s after 50 s of rest; turns up to 180 deg, accelerations of 0.5 m/s^2."""
    truths = [draw_truth(GRADES[grade], seed) for seed in range(seeds)]
    results = [
        calibrate_dynamic(record(truth, Hand(rate_hz=rate_hz), seed), stated(truth))
        for seed, truth in enumerate(truths)
    ]
    assert_consistent(results, truths)
    for result in results:
        assert result.survey.stages == ()
        assert 0.15 < result.survey.guard_s < 0.75
        assert result.static.determined
        assert result.static.left_out == ()
        # Nine differences a recording, each below a normal number: 4 sd once in two thousand.
        assert abs(result.static.largest[1]) < 4.0
        assert earth_is_possible(result)


def test_motion_overrides_what_is_found() -> None:
    truth, made = hand_short()
    right = calibrate_dynamic(made, stated(truth))
    assert np.abs(errors(right, truth) / right.sd[:21]).max() < 4.0
    by_word = calibrate_dynamic(replace(made, motion="hand"), stated(truth))
    assert np.array_equal(by_word.p, right.p)
    assert survey(replace(made, motion="table")).stages != ()


def test_a_stage_that_its_accelerations_contradict_is_not_believed() -> None:
    """Where an axis of the table swings, that axis alone is taken for a hand's."""
    table = mems_short()[1]
    found = survey(table)
    assert [stage.axis for stage in found.stages] == [0, 1, 2]
    samples = table.all()
    sideways = samples.force.copy()
    second = found.stages[1]
    inside = (samples.time_s > second.start_s + 13.0) & (samples.time_s < second.end_s)
    swing = 0.5 * np.sin(2 * np.pi * 0.7 * samples.time_s[inside])
    sideways[inside, 0] += swing  # up to 0.5 m/s^2 along an axis that turns through the vertical
    moved = survey(changed(table, force=sideways))
    assert [stage.axis for stage in moved.stages] == [0, 2]
    assert survey(replace(table, motion="hand")).stages == ()


def test_a_lever_arm_does_not_contradict_a_table() -> None:
    """200 mm from the axis at 60 deg/s: 0.2 m/s^2, which a place explains."""
    moves = (Move(360.0, 60.0, 3.0), Move(-450.0, 45.0, 3.0), Move(270.0, 30.0, 3.0))
    centres = ((30.0, 150.0, -120.0), (-110.0, 35.0, 160.0), (145.0, -130.0, -25.0))
    motion = ImuMotion(tuple(Mounting(moves, 12.0, centre_mm=centre) for centre in centres))
    found = survey(held(simulate_imu(mems_short()[0], motion, 50.0, 1)))
    assert [stage.axis for stage in found.stages] == [0, 1, 2]


def earth_is_possible(result: DynamicResult) -> bool:
    """Whether the check of the verdict holds, or the heading is known."""
    return all(check.held for check in earth(result))


# ---- shared and real recordings ----


def case(name: str) -> tuple[ImuRecording, DataSheet, dict[str, float]]:
    """A case with its truth; skips where it is absent."""
    folder = CASES / name
    if not folder.is_dir():
        pytest.skip(f"real recordings absent: no {name}/ in {CASES}")
    table = np.loadtxt(folder / "recording.csv", delimiter=",", skiprows=1)
    samples = ImuSamples(table[:, 0], table[:, 1:4], table[:, 4:7])
    about = {"rate_hz": 100.0, "latitude_deg": 50.0, "gravity_m_per_s2": 9.8107}
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))["truth"]
    return (
        recording_of(samples, name, **about),
        DataSheet(0.118794, 49.4975, accel_lsb=122.07),
        truth,
    )


def test_poses_of_two_seconds_by_hand_are_within_their_deviations() -> None:
    made, noise, truth = case("trans0")
    result = calibrate_dynamic(made, noise)
    error = np.array(
        [p - truth[s.name] for p, s in zip(result.p[:21], result.layout.states[:21], strict=True)]
    )
    assert (np.abs(error) < 3 * result.sd[:21]).all()
    assert 8 < error @ np.linalg.solve(result.covariance[:21, :21], error) < 39
    scales = result.layout.place("gyro-matrix").start + np.array([0, 4, 8])
    assert result.sd[scales].max() < 30e-6
    assert len(result.passes) <= 8  # four, and three with the bias instability that it shows


@pytest.mark.parametrize("stated", [True, False])
def test_biases_that_flicker_are_within_their_deviations(stated: bool) -> None:
    """White noise stated alone, and nothing at all; 4.8 and 39 are 1e-4 and 0.99 of chi-square."""
    made, noise, truth = case("flicker0")
    result = calibrate_dynamic(made, noise if stated else DataSheet())
    error = np.array(
        [p - truth[s.name] for p, s in zip(result.p[:21], result.layout.states[:21], strict=True)]
    )
    assert 4.8 < error @ np.linalg.solve(result.covariance[:21, :21], error) < 39
    assert {"gyro_bias_instability_deg_per_h", "accel_bias_instability_ug"} <= set(result.estimated)
    assert result.noise.gyro_bias_instability_deg_per_h


def white_noise(samples: ImuSamples, found: Survey, rate_hz: float) -> DataSheet:
    """Of the rests, by the differences of samples that follow each other; the noisiest axis."""
    values = np.column_stack([samples.rate, samples.force])
    edges = [(found.windows.first[r.first], found.windows.first[r.end - 1]) for r in found.rests]
    change = np.concatenate([np.diff(values[a:b], axis=0) for a, b in edges])
    sd = np.sqrt((change**2).mean(axis=0) / 2 / rate_hz)
    return DataSheet(float(np.degrees(sd[:3].max()) * 60), float(sd[3:].max() / 9.80665e-6))


BEFORE = (
    (291.7, 541.5, 384.7, 2671.1, 1749.7, 2294.6),
    (429.4, 379.9, 468.5, 3072.9, 1973.4, 2733.2),
    (360.5, 581.4, 377.4, 3069.9, 1810.7, 2197.7),
    (329.3, 390.0, 615.5, 3225.0, 1982.2, 2206.9),
    (523.3, 324.1, 193.1, 1816.6, 1949.8, 3265.7),
)
"""Standard deviations, ppm, of the scale factors of mikoff's five units by version 0.1.0, which cut
2 s on each side of a turn: Gamma11, 22, 33, Theta11, 22, 33."""


@pytest.mark.parametrize("unit", range(5))
def test_hand_rotations_agree_with_their_rests_alone(unit: int) -> None:
    table = np.loadtxt(recording("mikoff_mpu9150") / f"imu{unit}.log")
    samples = ImuSamples(np.arange(len(table)) / 100.0, table[:, 3:].copy(), table[:, :3].copy())
    about = {"rate_hz": 100.0, "latitude_deg": 55.7, "gravity_m_per_s2": 9.8155}
    made = recording_of(samples, f"imu{unit}", **about)
    found = survey(made)
    assert len(found.rests) >= 20
    assert found.stages == ()
    result = calibrate_dynamic(made, white_noise(samples, found, 100.0))
    assert np.abs(result.static.normalised).max() < 2.0
    assert earth_is_possible(result)
    names = [state.name for state in result.layout.states]
    kinds = ("Gamma11", "Gamma22", "Gamma33", "Theta11", "Theta22", "Theta33")
    now = [1e6 * result.sd[names.index(name)] for name in kinds]
    ratio = np.array(now) / BEFORE[unit]
    assert np.median(ratio) < 0.6
    assert ratio.max() < 1.0  # a single one moves with the noise that the rests show


def test_ten_poses_in_the_hand_between_turns_that_clip() -> None:
    """tomisuarez2: the gyros met 250 deg/s in three turns; its authors' biases by ten poses."""
    folder = recording("tomisuarez2_mpu6050")
    table = np.genfromtxt(
        folder / "example_data_calibration.csv", delimiter=",", skip_header=5, dtype=float
    )
    samples = ImuSamples(
        np.arange(len(table)) / 100.0,
        np.radians(table[:, 3:6] / 131.0),
        table[:, :3] / 16384.0 * 9.80665,
    )
    about = {"rate_hz": 100.0, "latitude_deg": -34.6, "gravity_m_per_s2": 9.797}
    made = recording_of(samples, "tomisuarez2", **about)
    found = survey(made)
    said = "a gyro clips at 39.1, 66.6, 87.6 s: not used from there to the next rest"
    assert said in found.findings
    result = calibrate_dynamic(made, white_noise(samples, found, 100.0))
    assert np.abs(result.static.normalised).max() < 2.0
    assert result.heading_rad is None
    assert earth_is_possible(result)
    published = np.array([712.0, -359.0, -1840.0]) / 16384.0 * 9.80665
    # Theirs are of ten poses with gravity taken as exactly 9.80665; 0.1 % of it is 10 mm/s^2.
    assert np.abs(result.p[:3] - published).max() < 3 * result.sd[:3].max() + 0.02
