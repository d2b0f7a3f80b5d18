"""What is wrong with poses of which only |a| = g is known: the cause is named, a sound unit is not.

Readings are in g: a sensor with biases, scale errors, misalignment and own-axis squares, by its own
equation, in six faces and random directions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import directions, write_unit
from test_recordings import calibrated

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.diagnosis import Diagnosis
from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.registry import POSE_CAUSES
from triaxcal.diagnosis.poses.core.cause import PoseHypothesis
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.model.types import FloatArray

GAIN = np.array([[1.012, 0.006, -0.004], [0.003, 0.991, 0.008], [-0.007, 0.002, 1.004]])
BIAS = np.array([0.032, -0.041, 0.015])
SQUARES = np.array([2e-3, -3e-3, 1e-3])
ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "{}"'


def readings(count: int, seed: int = 1, sd: float = 5e-4) -> FloatArray:
    a = directions(count, seed)
    noise = sd * np.random.default_rng(seed).standard_normal(a.shape)
    return np.asarray((a + SQUARES * a**2) @ GAIN.T + BIAS + noise)


def unit_of(folder: Path, poses: FloatArray, unit: str = "g") -> Path:
    return write_unit(folder, poses, ROWS.format(unit), header="a,b,c")


def diagnosed(folder: Path, poses: FloatArray, unit: str = "g") -> Diagnosis:
    return triaxcal.diagnose(unit_of(folder, poses, unit))


def refusal_of(folder: Path) -> str:
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    return str(refusal.value)


@pytest.mark.parametrize("count", [6, 12, 30])
def test_no_cause_is_told_of_sound_poses(tmp_path: Path, count: int) -> None:
    for seed, sd in ((0, 2e-4), (1, 3e-3)):
        found = diagnosed(tmp_path / f"{seed}", readings(count, seed, sd))
        assert not found.clear
        assert found.sentence == "no cause is more probable than a sound unit"


@pytest.mark.parametrize("wrong", [(4,), (4, 17), (4, 9, 17)])
def test_wrong_poses_are_named_all_of_them(tmp_path: Path, wrong: tuple[int, ...]) -> None:
    poses = readings(24)
    for k, longer in zip(wrong, (0.05, -0.04, 0.06), strict=False):
        poses[k] *= 1.0 + longer
    told = refusal_of(unit_of(tmp_path / "U", poses))
    for k in wrong:
        assert f"pose {k + 1} (line {k + 2})" in told
    lines = ", ".join(str(k + 2) for k in wrong)
    assert f"log.csv, line{'s' * (len(wrong) > 1)} {lines}: most probably " in told
    best = diagnosed(tmp_path / "V", poses).answer[0]
    sizes = sorted(a.value for a in best.amplitudes)
    assert sizes == pytest.approx(sorted((50.0, -40.0, 60.0)[: len(wrong)]), abs=6.0)


def test_what_is_held_out_without_wrong_poses_is_that_of_the_others_alone(tmp_path: Path) -> None:
    poses, wrong = readings(24), [5, 15]
    alone = diagnosed(tmp_path / "A", np.delete(poses, wrong, axis=0)).sound
    poses[wrong] *= [[1.03], [0.97]]
    best = diagnosed(tmp_path / "U", poses).suspects[0]
    assert best.cause == "poses"
    # The same readings and the same fit, but for the scale of the noise, found within 1 / sqrt(22).
    assert best.remaining.held_out_g == pytest.approx(alone.held_out_g, rel=0.2)


def test_nothing_is_held_out_of_poses_of_one_direction(tmp_path: Path) -> None:
    one = np.tile([0.02, -0.03, 1.01], (8, 1))
    one += 3e-4 * np.random.default_rng(2).standard_normal(one.shape)
    assert "micro-g" not in str(diagnosed(tmp_path / "U", one))


def test_small_wrong_poses_are_told_together_where_the_unit_passes(tmp_path: Path) -> None:
    poses = readings(30)
    poses[7] *= 1.009
    poses[21] *= 0.993
    told = "\n".join(calibrated(unit_of(tmp_path / "U", poses)).findings)
    assert "pose 8 (line 9) and pose 22 (line 23) are outliers: |a| differs by +" in told
    # Nothing is known better than a pose of 0.1 mg at least: no figure is rounding.
    noise = float(told.split("whose noise is ")[1].split()[0])
    assert 0.1 <= noise < 2.0
    assert "check them, remove them" in told


def test_many_poses_are_named_by_their_numbers_alone() -> None:
    """No good pose is among those that are named."""
    one = np.ones(24)
    numbers = np.arange(1, 25)
    own = PoseReadings(
        numbers, numbers + 1, readings(24), 0 * one, one, one, one, 1.0, 1.0, nominal=True
    )
    some = np.array([1, 4, 5, 6, 13, 16, 19])
    assert own.words(some) == "poses 2, 5-7, 14, 17, 20"
    assert own.words(some[:2]) == "pose 2 (line 3) and pose 5 (line 6)"


def test_a_dead_output_is_no_plane(tmp_path: Path) -> None:
    poses = readings(16)
    poses[:, 1] = 0.01
    told = refusal_of(unit_of(tmp_path / "U", poses))
    assert "most probably an output that does not answer, output y" in told
    assert "one plane" not in told


def test_poses_in_a_plane_are_no_dead_output(tmp_path: Path) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    a = np.column_stack([np.zeros(16), np.cos(angle), np.sin(angle)])
    poses = a @ GAIN.T + BIAS + 5e-4 * np.random.default_rng(3).standard_normal(a.shape)
    assert not diagnosed(tmp_path / "U", poses).clear


@pytest.mark.parametrize(("sign", "words"), [(1.0, "repeats"), (-1.0, "is the negative of")])
def test_a_copied_output_is_named(tmp_path: Path, sign: float, words: str) -> None:
    poses = readings(16)
    poses[:, 2] = sign * poses[:, 0]
    told = refusal_of(unit_of(tmp_path / "U", poses))
    assert f"most probably a copied output, output z {words} output x" in told


def test_an_output_that_saturates_is_named_with_its_level(tmp_path: Path) -> None:
    poses = readings(24)
    noise = 2e-4 * np.random.default_rng(4).standard_normal(24)
    poses[:, 0] = np.where(poses[:, 0] > 0.7, 0.7 + noise, poses[:, 0])
    best = diagnosed(tmp_path / "U", poses).answer[0]
    assert best.cause == "saturated"
    assert best.place.startswith("output x at +0.7")


@pytest.mark.parametrize("kind", ["step", "drift"])
def test_biases_that_change_with_time_are_named(tmp_path: Path, kind: str) -> None:
    poses = readings(30)
    share = (np.arange(30) >= 14) if kind == "step" else np.arange(30) / 29.0
    poses += share[:, None] * np.array([0.03, -0.02, 0.04])
    best = diagnosed(tmp_path / "U", poses).answer[0]
    assert best.cause == kind
    assert [a.value for a in best.amplitudes] == pytest.approx([30.0, -20.0, 40.0], abs=6.0)
    if kind == "step":
        assert best.place == "before pose 15 (line 16)"


def test_scales_that_are_wrong_are_named(tmp_path: Path) -> None:
    poses = readings(16)
    whole = diagnosed(tmp_path / "W", poses, "m/s^2").answer[0]
    assert (whole.cause, whole.change) == ("scale", 'with acceleration_unit = "g"')
    # 12 bits of +-4 g: 512 counts for 1 g, under the name of mg.
    counts = diagnosed(tmp_path / "C", np.rint(512.0 * poses), "mg").answer[0]
    assert (counts.cause, counts.place) == ("scale", "they are 0.5 times what they would be in mg")
    one = poses.copy()
    one[:, 1] *= 2.0
    assert (
        diagnosed(tmp_path / "O", one).answer[0].place
        == "output y is 2 times as large as the others"
    )
    changed = poses.copy()
    changed[9:] *= 0.5
    best = diagnosed(tmp_path / "R", changed).answer[0]
    assert best.name.endswith("range, from pose 10 (line 11) on they are 0.5 times as large")


@pytest.mark.parametrize(("unit", "one_g"), [("m/s^2", 65536.0), ("m/s^2", 7966.0), ("g", 16.4)])
def test_readings_in_no_unit_are_refused_as_by_calib(
    tmp_path: Path, unit: str, one_g: float
) -> None:
    folder = unit_of(tmp_path / "U", np.rint(readings(16) * one_g * 4.0) / 4.0, unit)
    with pytest.raises(RefusedError, match=r"long; expected about .*; if these are raw") as refusal:
        triaxcal.diagnose(folder)
    assert str(refusal.value) == refusal_of(folder)


def test_noise_with_wild_poses_is_no_cause_of_the_list(tmp_path: Path) -> None:
    wild = 0.06 * np.random.default_rng(8).standard_normal((24, 1))
    best = diagnosed(tmp_path / "U", readings(24) * (1.0 + wild)).answer[0]
    assert best.cause == "unknown"


def test_a_cause_of_ones_own_competes(tmp_path: Path) -> None:
    def places(_known: object) -> list[PoseHypothesis]:
        return [PoseHypothesis("full moon", log_prior=20.0, change="of the night")]

    own = Cause("moon", "the moon", "Tides.", places, "the almanac")
    with POSE_CAUSES.added(own):
        found = diagnosed(tmp_path / "U", readings(12))
    assert found.answer[0].name == "the moon, full moon"


def test_known_directions_are_refused_with_what_names_their_faults(tmp_path: Path) -> None:
    layout = ROWS.format("g") + '\ndirection = ["dx", "dy", "dz"]'
    rows = np.hstack([readings(8), directions(8)])
    folder = write_unit(tmp_path / "U", rows, layout, header="a,b,c,dx,dy,dz")
    with pytest.raises(RefusedError, match="it names wrong rows, exchanged columns"):
        triaxcal.diagnose(folder)
