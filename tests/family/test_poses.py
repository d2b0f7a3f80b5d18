"""Still stretches of logs that hands made: which are found, how well their means are known."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import COLUMNS, U0, K, directions, write_unit

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.fitting.route import calibrate_recording
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet, find_poses, orientation_groups
from triaxcal.poses.steps import Steps
from triaxcal.readings.samples import read_samples
from triaxcal.unit.description import read_unit

RATE_HZ = 100.0
UNITS = 'acceleration = ["ax", "ay", "az"]\nacceleration_unit = "g"\ntime = "t"'


def band(
    random: np.random.Generator, count: int, low_hz: float, high_hz: float, rms: float
) -> FloatArray:
    """Noise between two frequencies, (count, 3)."""
    spectrum = random.standard_normal((count // 2 + 1, 3)) + 1j * random.standard_normal(
        (count // 2 + 1, 3)
    )
    frequency = np.fft.rfftfreq(count, 1.0 / RATE_HZ)
    spectrum[(frequency < low_hz) | (frequency > high_hz)] = 0.0
    noise = np.fft.irfft(spectrum, count, axis=0)
    result: FloatArray = noise * (rms / noise.std())
    return result


def turn(start: FloatArray, end: FloatArray, deg_per_s: float) -> FloatArray:
    """Directions of gravity while the unit turns from one pose to the next at a steady rate."""
    angle = float(np.arccos(np.clip(start @ end, -1.0, 1.0)))
    across = end - (start @ end) * start
    across /= np.linalg.norm(across)
    part = np.linspace(0.0, angle, max(round(np.degrees(angle) / deg_per_s * RATE_HZ), 10))
    result: FloatArray = np.cos(part)[:, None] * start + np.sin(part)[:, None] * across
    return result


def hand_held(
    holds_s: FloatArray, deg_per_s: float, tremor_g: float, sway_deg: float, seed: int
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Time and readings in g, and the stretches that are held still."""
    random = np.random.default_rng(seed)
    poses = random.standard_normal((len(holds_s), 3))
    poses /= np.linalg.norm(poses, axis=1, keepdims=True)
    parts, still, count = [], [], 0
    for k, (pose, hold_s) in enumerate(zip(poses, holds_s, strict=True)):
        held = round(hold_s * RATE_HZ)
        still.append((count, count + held))
        parts.append(np.tile(pose, (held, 1)))
        if k + 1 < len(poses):
            parts.append(turn(pose, poses[k + 1], deg_per_s))
        count = sum(map(len, parts))
    force = np.concatenate(parts)
    sway = band(random, count, 0.15, 1.2, np.radians(sway_deg))
    force = force + np.cross(sway, force)
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    force += band(random, count, 8.0, 12.0, tremor_g) + 0.003 * random.standard_normal((count, 3))
    return np.column_stack([np.arange(count) / RATE_HZ, force]), still


def found_in(folder: Path) -> PoseSet:
    unit = read_unit(folder)
    assert unit.recording is not None
    return find_poses(read_samples(folder, unit.recording, unit.temperature_sensor), unit.recording)


def matched(poses: PoseSet, still: list[tuple[int, int]]) -> list[float]:
    """Share of each still stretch that its pose has; every pose must lie in one, but for a fifth.

    Line 2 is the first row.
    """
    shares = [0.0] * len(still)
    for pose in poses.poses:
        start, stop = pose.line - 2, pose.line - 2 + pose.count
        inside = [max(0, min(stop, e) - max(start, s)) for s, e in still]
        best = int(np.argmax(inside))
        assert inside[best] >= 0.8 * (stop - start), f"pose {pose.number} moves"
        shares[best] += inside[best] / (still[best][1] - still[best][0])
    return shares


@pytest.mark.parametrize(
    ("holds_s", "deg_per_s", "tremor_g", "sway_deg"),
    [
        ((2.0, 5.0), 60.0, 0.02, 0.6),
        ((0.7, 2.0), 60.0, 0.02, 0.4),
        ((1.0, 3.0), 90.0, 0.03, 1.2),
        ((2.0, 4.0), 12.0, 0.01, 0.2),
    ],
    ids=["as usual", "short", "shaky", "slow turns"],
)
def test_poses_of_a_hand_are_found_and_no_others(
    tmp_path: Path,
    holds_s: tuple[float, float],
    deg_per_s: float,
    tremor_g: float,
    sway_deg: float,
) -> None:
    for seed in range(3):
        holds = np.random.default_rng(seed).uniform(*holds_s, 12)
        rows, still = hand_held(holds, deg_per_s, tremor_g, sway_deg, seed)
        poses = found_in(write_unit(tmp_path / f"U{seed}", rows, UNITS))
        shares = matched(poses, still)
        assert min(shares) > 0.5
        assert len(poses.poses) == 12


def test_poses_on_a_table_and_in_a_hand_each_have_their_own_stillness(tmp_path: Path) -> None:
    """One level for both would either cut the poses of the hand or take turns into the others."""
    table, still = hand_held(np.full(6, 3.0), 60.0, 1e-6, 1e-6, 1)
    hand, moving = hand_held(np.full(6, 3.0), 60.0, 0.03, 1.2, 2)
    hand[:, 0] += table[-1, 0] + 1.0 / RATE_HZ
    path = turn(table[-1, 1:] / np.linalg.norm(table[-1, 1:]), hand[0, 1:], 60.0)
    between = np.column_stack([np.zeros(len(path)), path])
    rows = np.concatenate([table, between, hand])
    rows[:, 0] = np.arange(len(rows)) / RATE_HZ
    first = len(table) + len(between)
    poses = found_in(write_unit(tmp_path / "U", rows, UNITS))
    shares = matched(poses, still + [(s + first, e + first) for s, e in moving])
    assert len(poses.poses) == 12
    assert min(shares) > 0.6
    sd, weights = poses.length_sd, poses.weights
    assert sd is not None
    assert weights is not None
    assert np.median(sd[6:]) > 3.0 * np.median(sd[:6])
    assert np.median(weights[6:]) < 0.3 * np.median(weights[:6])


def test_a_knock_does_not_cut_a_pose(tmp_path: Path) -> None:
    rows, _ = hand_held(np.full(8, 4.0), 60.0, 1e-6, 1e-6, 3)
    for start in (150, 1000):
        rows[start : start + 10, 1] += 0.2 * np.sin(np.linspace(0.0, 2.0 * np.pi, 10))
    assert len(found_in(write_unit(tmp_path / "U", rows, UNITS)).poses) == 8


def test_the_uncertainty_of_a_mean_covers_its_error(tmp_path: Path) -> None:
    """Correlated noise: 0.2 s of an autoregression, of which independent samples know nothing."""
    random = np.random.default_rng(4)
    poses, ratios = directions(14), []
    for seed in range(6):
        noise = 0.01 * random.standard_normal((14 * 400, 3))
        for k in range(1, len(noise)):
            noise[k] += 0.9 * noise[k - 1]
        rows = noise + np.repeat(poses, 400, axis=0)
        folder = write_unit(
            tmp_path / f"U{seed}", np.column_stack([np.arange(len(rows)) / RATE_HZ, rows]), UNITS
        )
        for pose in found_in(folder).poses:
            assert pose.sd_mean is not None
            truth = poses[(pose.line - 2 + pose.count // 2) // 400]
            ratios += ((pose.reading - truth) / pose.sd_mean).tolist()
    # Eight parts of a pose: Student's t with 7 degrees of freedom has a variance of 7 / 5, and
    # neighbouring parts are still a little alike.
    assert len(ratios) > 200
    assert 0.7 < float(np.mean(np.square(ratios))) < 2.2


# ---- steps of the readings ----


def test_steps_coarser_than_noise_are_told_with_what_they_leave(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    rows, still = hand_held(np.full(16, 3.0), 60.0, 1e-6, 1e-6, 5)
    truth = np.array([rows[s + 5 : e - 5, 1:].mean(axis=0) for s, e in still])
    rows[:, 1:] += 0.001 * random.standard_normal((len(rows), 3))
    rows[:, 1:] = np.rint(rows[:, 1:] / 0.02) * 0.02
    poses = found_in(write_unit(tmp_path / "U", rows, UNITS))
    assert min(matched(poses, still)) > 0.6
    assert len(poses.poses) == 16
    (told,) = poses.findings
    assert told.startswith("the readings have steps of 0.02 g (20 mg), coarser than their noise")
    error = poses.readings - truth
    sd = np.array([p.sd_mean for p in poses.poses])
    # 48 values: their rms is within a fifth of its expectation in two cases of three.
    assert 0.6 < float(np.sqrt(np.mean((error / sd) ** 2))) < 1.5


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.4, 0.8])
def test_what_rounding_leaves_in_a_mean(noise: float) -> None:
    """Against means of rounded readings, the truth anywhere between two codes."""
    random = np.random.default_rng(6)
    truth = random.uniform(0.0, 1.0, (1500, 1))
    rounded = np.rint(truth + noise * random.standard_normal((1500, 2000)))
    error = float(np.sqrt(np.mean((rounded.mean(axis=1) - truth[:, 0]) ** 2)))
    scatter = np.repeat(rounded.std(axis=1)[:, None], 3, axis=1)
    stated = Steps(np.array([1.0, 0.0, 0.0])).sd_of_mean(scatter)
    assert not stated[:, 1:].any()
    sampled = noise / np.sqrt(2000.0)
    assert np.hypot(stated[0, 0], sampled) == pytest.approx(error, rel=0.15, abs=0.003)


# ---- units ----


@pytest.mark.parametrize("unit", ["m/s^2", "g", "mg"])
@pytest.mark.parametrize(("step", "middle", "told"), [
    (16.0, 32768.0, "all are multiples of 16: codes with 4 empty bits at the right, as 12 bits"),
    (1.0, 0.0, "all are whole numbers"),
])  # fmt: skip
def test_codes_under_the_name_of_a_unit_are_called_counts(
    tmp_path: Path, unit: str, step: float, middle: float, told: str
) -> None:
    rows, _ = hand_held(np.full(10, 2.0), 60.0, 0.01, 0.3, 7)
    rows[:, 1:] = np.rint(16384.0 / step * rows[:, 1:]) * step + middle
    with pytest.raises(RefusedError) as refused:
        found_in(write_unit(tmp_path / "U", rows, UNITS.replace('"g"', f'"{unit}"')))
    assert told in str(refused.value)
    assert refused.value.remedy == 'these are counts: acceleration_unit = "count"'


def test_milligrams_under_the_name_of_g_are_named(tmp_path: Path) -> None:
    rows, _ = hand_held(np.full(10, 2.0), 60.0, 0.01, 0.3, 8)
    rows[:, 1:] *= 1000.0
    with pytest.raises(RefusedError, match='then acceleration_unit = "mg"'):
        found_in(write_unit(tmp_path / "U", rows, UNITS))


# ---- recordings that are none of poses ----


def test_a_log_that_moves_all_the_time_is_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(9)
    force = np.array([0.0, 0.0, 1.0]) + np.cumsum(band(random, 6000, 0.1, 1.0, 0.05), axis=0)
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    rows = np.column_stack([np.arange(6000) / RATE_HZ, force + band(random, 6000, 0.5, 6.0, 0.05)])
    with pytest.raises(RefusedError) as refused:
        found_in(write_unit(tmp_path / "U", rows, UNITS))
    assert refused.value.found.startswith("no pose found: ")
    assert "poses of at least 0.5 s, held much more still than the turns" in str(refused.value)


def test_one_pose_alone_is_one_pose(tmp_path: Path) -> None:
    noise = 0.003 * np.random.default_rng(10).standard_normal((1000, 3))
    rows = np.column_stack([np.arange(1000) / RATE_HZ, np.array([0.1, -0.2, 0.97]) + noise])
    (pose,) = found_in(write_unit(tmp_path / "U", rows, UNITS)).poses
    assert pose.count == 1000
    assert found_in(write_unit(tmp_path / "V", rows * [1, 16384, 16384, 16384], UNITS.replace(
        '"g"', '"count"'))).poses[0].count == 1000  # fmt: skip


def test_one_row_is_no_pose(tmp_path: Path) -> None:
    rows = np.array([[0.0, 0.1, -0.2, 9.7]])
    with pytest.raises(RefusedError, match="no pose found"):
        found_in(write_unit(tmp_path / "U", rows, COLUMNS))


def test_many_orientations_are_grouped_without_a_table_of_all_pairs() -> None:
    """A hundred thousand rows: all pairs would take 80 GB."""
    poses = np.repeat(directions(20), 5000, axis=0)
    groups = orientation_groups(poses)
    assert [len(g) for g in groups] == [5000] * 20


# ---- known directions ----

DIRECTED = (
    'rows = "poses"\nacceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"\n'
    'direction = ["dx", "dy", "dz"]'
)


def test_unit_vectors_are_known_directions(tmp_path: Path) -> None:
    """All twelve constants come back, also K that is not symmetric: |a| = g alone has nine."""
    force = directions(20)
    noise = 1e-4 * np.random.default_rng(11).standard_normal((20, 3))
    rows = np.column_stack([force @ K.T + U0 + noise, force])
    folder = write_unit(tmp_path / "U", rows, DIRECTED, header="ax,ay,az,dx,dy,dz")
    unit = read_unit(folder)
    assert unit.recording is not None
    constants = calibrate_recording(unit, unit.recording, folder)[2].thermal.constants_at(20.0)
    # 20 poses of 1e-4 m/s^2: three axes share them, four standard errors.
    assert np.abs(constants[:9].reshape(3, 3) - K).max() < 4.0 * 1e-4 / np.sqrt(20.0 / 3.0)
    assert np.abs(constants[9:] - U0).max() < 4.0 * 1e-4 / np.sqrt(20.0)


def test_rows_that_are_poses_have_no_invented_times(tmp_path: Path) -> None:
    text = CliRunner().invoke(main, ["poses", str(directed(tmp_path / "U", (1, 1, 1)))]).stdout
    for words in ("from s", "still s", "drift mg", "at rest"):
        assert words not in text
    assert text.rstrip().endswith("\n20 poses")


def directed(folder: Path, signs: tuple[int, int, int], more: str = "") -> Path:
    """A unit whose outputs have these signs against their directions."""
    force = directions(20)
    noise = 1e-4 * np.random.default_rng(11).standard_normal((20, 3))
    rows = np.column_stack([(force @ K.T) * signs + U0 + noise, force])
    return write_unit(folder, rows, DIRECTED + more, header="ax,ay,az,dx,dy,dz")


def constants_of(folder: Path) -> FloatArray:
    unit = read_unit(folder)
    assert unit.recording is not None
    return calibrate_recording(unit, unit.recording, folder)[2].thermal.constants_at(20.0)


@pytest.mark.parametrize("signs", list(product((1, -1), repeat=3)), ids=str)
def test_columns_that_a_refusal_offers_give_the_force_itself(
    tmp_path: Path, signs: tuple[int, int, int]
) -> None:
    """Whatever outputs are inverted: what is advised is a calibration of the known directions."""
    folder, keys = directed(tmp_path / "U", signs), DIRECTED
    if min(signs) < 0:
        with pytest.raises(RefusedError) as refusal:
            constants_of(folder)
        told = str(refusal.value)
        words = {1: "left-handed axes?", -1: "half a turn of the sensor about", -3: "upward"}
        assert words[sum(signs)] in told
        offered = told[told.index("acceleration = [") :]
        keys = keys.replace('acceleration = ["ax", "ay", "az"]', offered)
        toml = folder / "unit.toml"
        toml.write_text(toml.read_text().replace(DIRECTED, keys))
    # The constants are those of the outputs as read, so that the result is the known force.
    found = constants_of(folder)[:9].reshape(3, 3)
    assert np.abs(found - np.array(signs)[:, None] * K).max() < 4.0 * 1e-4 / np.sqrt(20.0 / 3.0)


def test_inverted_outputs_of_a_stated_polarity_give_the_force_itself(tmp_path: Path) -> None:
    folder = directed(tmp_path / "U", (-1, -1, -1), "\n[sensor]\npolarity = [-1, -1, -1]")
    found = constants_of(folder)[:9].reshape(3, 3)
    assert np.abs(found + K).max() < 4.0 * 1e-4 / np.sqrt(20.0 / 3.0)
    right = directed(tmp_path / "V", (1, 1, 1), "\n[sensor]\npolarity = [-1, -1, -1]")
    with pytest.raises(RefusedError, match="expected x, y, z along -x, -y, -z"):
        constants_of(right)


def test_a_vector_that_points_the_other_way_is_named(tmp_path: Path) -> None:
    force = directions(20)
    noise = 1e-4 * np.random.default_rng(11).standard_normal((20, 3))
    readings = force @ K.T + U0 + noise
    force[3] *= -1.0
    rows = np.column_stack([readings, force])
    folder = write_unit(tmp_path / "U", rows, DIRECTED, header="ax,ay,az,dx,dy,dz")
    with pytest.raises(RefusedError, match="the vector of line 5 points the other way") as refusal:
        constants_of(folder)
    assert "pitch" not in str(refusal.value)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda rows, keys: (rows * [1, 1, 1, 2, 2, 2], keys), "a direction 2 long; expected unit"),
        (
            lambda rows, keys: (rows, keys.replace('rows = "poses"', 'time = "ax"')),
            "directions with rows of samples",
        ),
        (
            lambda rows, keys: (rows, keys + '\npitch = "dx"'),
            "given together with angles; expected one of them",
        ),
    ],
    ids=["no unit vectors", "samples", "angles besides"],
)
def test_directions_that_say_nothing_are_refused(
    tmp_path: Path, change: Callable[[FloatArray, str], tuple[FloatArray, str]], told: str
) -> None:
    force = directions(12)
    rows, keys = change(np.column_stack([force @ K.T + U0, force]), DIRECTED)
    folder = write_unit(tmp_path / "U", rows, keys, header="ax,ay,az,dx,dy,dz")
    with pytest.raises(RefusedError, match=told):
        found_in(folder)


# ---- several files ----


def two_files(folder: Path, file: str, second: Callable[[FloatArray], FloatArray]) -> Path:
    """Six poses each; the clock of the second starts anew."""
    for name, seed in (("a.csv", 12), ("b.csv", 13)):
        rows, _ = hand_held(np.full(6, 2.5), 60.0, 0.005, 0.2, seed)
        rows = second(rows) if name == "b.csv" else rows
        write_unit(folder, rows, UNITS)
        (folder / "log.csv").rename(folder / name)
    toml = (folder / "unit.toml").read_text().replace('file = "log.csv"', f"file = {file}")
    (folder / "unit.toml").write_text(toml)
    return folder


@pytest.mark.parametrize("file", ['["a.csv", "b.csv"]', '"?.csv"'], ids=["list", "pattern"])
def test_two_files_are_one_recording(tmp_path: Path, file: str) -> None:
    poses = found_in(two_files(tmp_path / "U", file, lambda rows: rows))
    assert [pose.file for pose in poses.poses] == ["a.csv"] * 6 + ["b.csv"] * 6
    assert poses.findings[0].startswith("2 files as one recording; no pose extends from one into")
    # Six poses 2.5 s long, none across the joint; lines are those of each file.
    assert max(pose.duration_s for pose in poses.poses) <= 2.5
    assert poses.poses[6].line < 12
    starts = [pose.start_s for pose in poses.poses]
    assert starts == sorted(starts)
    rows, _ = hand_held(np.full(6, 2.5), 60.0, 0.005, 0.2, 13)
    alone = found_in(write_unit(tmp_path / "V", rows, UNITS))
    np.testing.assert_allclose(poses.readings[6:], alone.readings, rtol=0, atol=0.002)


def test_no_pose_extends_over_a_joint_even_of_one_orientation(tmp_path: Path) -> None:
    """The second file goes on where the first ends, as a logger does that splits its files."""
    folder = two_files(tmp_path / "U", '["a.csv", "b.csv"]', lambda rows: rows)
    text = (folder / "a.csv").read_text().splitlines()
    (folder / "b.csv").write_text("\n".join([text[0], *text[-100:]]) + "\n")
    (folder / "a.csv").write_text("\n".join(text[:-100]) + "\n")
    poses = found_in(folder).poses
    assert [pose.file for pose in poses] == ["a.csv"] * 6 + ["b.csv"]


def test_sections_of_one_label_in_two_files_are_two(tmp_path: Path) -> None:
    folder = tmp_path / "U"
    for name, labels in (("a.csv", "xyz"), ("b.csv", "zwv")):
        lines = ["pose,ax,ay,az"]
        for k, label in enumerate(labels):
            force = directions(6)[k + 3 * (name == "b.csv")]
            lines += [f"{label},{x:.4f},{y:.4f},{z:.4f}" for x, y, z in [force * 9.8] * 20]
        keys = COLUMNS.replace('\ntime = "t"', "") + '\nrows = "sections"\nsection = "pose"'
        write_unit(folder, "\n".join(lines), keys)
        (folder / "log.csv").rename(folder / name)
    toml = (folder / "unit.toml").read_text().replace('"log.csv"', '["a.csv", "b.csv"]')
    (folder / "unit.toml").write_text(toml)
    poses = found_in(folder).poses
    assert [(p.file, p.label) for p in poses] == [
        *(("a.csv", label) for label in "xyz"),
        *(("b.csv", label) for label in "zwv"),
    ]
    np.testing.assert_allclose([p.reading for p in poses], directions(6) * 9.8, atol=1e-4)


def test_files_of_different_rates_are_refused(tmp_path: Path) -> None:
    folder = two_files(tmp_path / "U", '["a.csv", "b.csv"]', lambda rows: rows * [1000, 1, 1, 1])
    with pytest.raises(RefusedError, match=r"b.csv: a row every 10 s, but every 0.01 s in a.csv"):
        found_in(folder)
