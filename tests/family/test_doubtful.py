"""Poses that the others contradict, and calibrations that nothing checks: both are told."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, U0, K, directions, log, write_unit
from scipy.special import fdtrc
from test_recordings import WITH_GYRO, calibrated, left_handed
from test_tables import AIR, HEADER, rows_of, table

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.outliers import CHANCE, fisher_tail, noncentrality, worst_outlier
from triaxcal.model.types import FloatArray
from triaxcal.report.words.temperatures import with_room
from triaxcal.uncertainty.expected import exceeded_with


def findings(folder: Path) -> str:
    return "\n".join(calibrated(folder).findings)


# ---- one wrong pose ----


@pytest.mark.parametrize("components", [1, 2, 3])
def test_the_tail_of_f_is_scipys(components: int) -> None:
    """Of one to a million degrees of freedom, from where the fraction is used."""
    for dof in (1, 2, 3, 5, 10, 37, 100, 999, 10_000, 1_000_000):
        for ratio in (1.0, 1.5, 5.0, 10.0, 100.0, 1e4):
            expected = float(fdtrc(components, dof, ratio))
            a, b = dof / 2, components / 2
            # The exponent is a sum of these magnitudes; each is wrong by a few roundings of its
            # own size, here and in SciPy, and so the relative error of its exponential.
            sizes = [math.lgamma(a), math.lgamma(b), math.lgamma(a + b), 1.0]
            sizes += [a * math.log1p(b * ratio / a), b * math.log1p(a / (b * ratio))]
            rel = 8 * np.finfo(float).eps * sum(map(abs, sizes))
            found = fisher_tail(components, dof, ratio)
            assert found == pytest.approx(expected, rel=rel, abs=5e-324)


@pytest.mark.parametrize(("components", "dof"), [(6, 1), (6, 5), (6, 10), (14, 1_000_000)])
def test_a_change_is_found_as_often_as_stated_by_few_degrees_of_freedom(
    components: int, dof: int
) -> None:
    """Chi-squares are drawn; the standard error of 95 % by 40 000 is 0.11 %."""
    ratio = exceeded_with(CHANCE, components, dof) / components
    h = noncentrality(0.95, components, dof, ratio)
    random = np.random.default_rng(3)
    own = random.noncentral_chisquare(components, h, 40_000) / components
    found = own / (random.chisquare(dof, 40_000) / dof) > ratio
    assert found.mean() == pytest.approx(0.95, abs=0.0055)


def test_the_f_of_a_pose_left_out_is_fishers() -> None:
    """Of sound data one in a thousand has a pose told, by 20 000 straight lines of ten points."""
    random = np.random.default_rng(1)
    x = np.stack([np.ones(10), np.arange(10.0)], axis=1)
    hat = x @ np.linalg.inv(x.T @ x) @ x.T
    y = random.standard_normal((20_000, 10, 2))
    own = y - np.einsum("ij,njk->nik", hat, y)
    left_out = own / (1.0 - np.diag(hat))[None, :, None]
    told = sum(worst_outlier(o, d, 4) is not None for o, d in zip(own, left_out, strict=True))
    # Bonferroni's bound is 20, and near: between its fourfold standard errors.
    assert 4 <= told <= 38


def test_a_row_of_angles_that_is_wrong_is_refused_by_its_line(tmp_path: Path) -> None:
    rows = rows_of(table())
    rows[6, 1] += 10.0
    with pytest.raises(RefusedError) as refusal:
        calibrated(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    told = str(refusal.value)
    assert (
        "log.csv, line 8: pose 7 contradicts the others: the file has pitch -15, roll -5 deg"
        in told
    )
    # 10 deg at a pitch of 15 deg: 2 sin 5 deg cos 15 deg.
    assert re.search(
        r"others gives pitch -15\.?\d*, roll -1[45]\.?\d* deg; the difference is 168 mg", told
    )
    assert "expected at most 20 mg (limits.at_t0_g); check its angles and readings" in told


def test_a_row_within_the_limit_is_told_and_passes(tmp_path: Path) -> None:
    rows = rows_of(table())
    rows[6, 1] += 0.5
    told = findings(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    assert "pose 7 contradicts the others: the file has pitch -15, roll -14.5 deg" in told
    assert "contradicts" not in findings(
        write_unit(tmp_path / "V", rows_of(table()), AIR, header=HEADER)
    )


def test_one_of_six_faces_on_the_table_is_told_with_its_rival(tmp_path: Path) -> None:
    """Opposite faces have equal residuals: which of them is wrong nobody can say."""
    angles = np.radians([[0, 0], [0, 90], [0, 180], [0, -90], [90, 0], [-90, 0]])
    rows = rows_of(angles, error_arcsec=20.0)
    rows[1, 2:] += [0.0, 0.0, 1.0]
    with pytest.raises(RefusedError, match="line 3: pose 2 or pose 4 contradicts"):
        calibrated(write_unit(tmp_path / "U", rows, AIR, header=HEADER))


def test_a_pose_whose_length_is_wrong_is_told(tmp_path: Path) -> None:
    poses = directions(20)
    poses[8] *= 1.004
    told = findings(write_unit(tmp_path / "U", log(poses)))
    # 4 mg, by a pose that the rest determine to 0.2 mg.
    size = re.search(
        r"pose 9 \(line \d+\) is an outlier: \|a\| differs by \+([\d.]+) mg from", told
    )
    assert size is not None
    assert float(size[1]) == pytest.approx(4.0, abs=0.6)
    assert "outlier" not in findings(write_unit(tmp_path / "V", log(directions(20))))


def test_a_wrong_pose_that_makes_a_small_model_win_is_told(tmp_path: Path) -> None:
    """14 poses, one 1 % too long: six constants are chosen, in which it is no outlier."""
    poses = directions(14)
    poses[9] *= 1.01
    told = findings(write_unit(tmp_path / "U", log(poses)))
    size = re.search(
        r"pose 10 \(line \d+\) is an outlier: \|a\| differs by \+([\d.]+) mg from", told
    )
    assert size is not None
    assert float(size[1]) == pytest.approx(10.0, abs=1.5)


ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'
ROBUST = '[fit]\nterms = "linear"\nloss = "cauchy"\n'


def told_by_cauchy(folder: Path, poses: FloatArray, seed: int) -> str:
    noise = 0.01 * np.random.default_rng(seed).standard_normal(poses.shape)
    return findings(write_unit(folder, poses @ K.T + U0 + noise, ROWS, header="a,b,c", more=ROBUST))


def test_sound_poses_are_not_told_by_a_robust_fit(tmp_path: Path) -> None:
    """A loss that gives up a pose makes the others fit by themselves: that proves nothing of it."""
    for seed in (5, 9, 10, 13):
        assert "outlier" not in told_by_cauchy(tmp_path / f"{seed}", directions(14, seed), seed)


def test_a_robust_loss_is_not_advised_where_it_is_set(tmp_path: Path) -> None:
    poses = directions(20)
    poses[8] *= 1.02
    told = told_by_cauchy(tmp_path / "U", poses, 1)
    size = re.search(
        r"pose 9 \(line 10\) is an outlier: \|a\| differs by \+([\d.]+) mg .* check it, or remove",
        told,
    )
    assert size is not None
    # 20 mg, by a pose that the rest determine to 1 mg, each being good to 1 mg.
    assert float(size[1]) == pytest.approx(20.0, abs=5.0)
    assert "huber" not in told


LABELS = ("top", "front", "bottom", "back", "left", "right")
FACES = (
    'section = "part"\nfaces = {top = "+z", bottom = "-z", front = "-y", back = "+y", '
    'left = "-x", right = "+x"}'
)


def labelled(turn_deg: float = 0.0, labels: tuple[str, ...] = LABELS) -> str:
    """Six faces, the second of them turned by an angle about z; placement of 0.01 deg."""
    random = np.random.default_rng(5)
    faces = directions(6) + 2e-4 * random.standard_normal((6, 3))
    t = np.radians(turn_deg)
    faces[1] = [np.sin(t), -np.cos(t), 0.0]
    lines = ["t,ax,ay,az,part"]
    for k, (face, label) in enumerate(zip(faces, labels, strict=True)):
        reading = face @ K.T + U0
        lines += [f"{k * 10 + n},{','.join(f'{v:.7f}' for v in reading)},{label}" for n in range(5)]
    return "\n".join(lines) + "\n"


def test_a_face_that_is_turned_is_told_with_the_face_opposite(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", labelled(5.0), f"{COLUMNS}\n{FACES}")
    told = findings(folder)
    assert "face -y (row 7) or face +y (row 17) at 20 degC contradicts" in told
    # 5 deg are 87.2 mg; the placement of the others, 0.2 mg, reaches it through the constants.
    size = re.search(r"contradicts the other positions by ([\d.]+) mg", told)
    assert size is not None
    assert float(size[1]) == pytest.approx(87.2, abs=1.5)
    assert "no temperature in the recording" in told
    assert "contradicts" not in findings(
        write_unit(tmp_path / "V", labelled(), f"{COLUMNS}\n{FACES}")
    )


# ---- labels and columns ----


def test_a_label_that_is_misspelt_is_told_as_a_label(tmp_path: Path) -> None:
    text = labelled(labels=("top", "front", "bottom", "back", "lefft", "right"))
    with pytest.raises(RefusedError) as refusal:
        calibrated(write_unit(tmp_path / "U", text, f"{COLUMNS}\n{FACES}"))
    assert "no section 'left', -x up (did you mean \"lefft\"?); sections found: back" in str(
        refusal.value
    )
    short = FACES.replace(', right = "+x"', "")
    with pytest.raises(RefusedError, match=r"\[recording\] faces: no label for \+x; expected six"):
        calibrated(write_unit(tmp_path / "V", labelled(), f"{COLUMNS}\n{short}"))


def test_columns_are_given_as_they_should_stand(tmp_path: Path) -> None:
    folder = write_unit(
        tmp_path / "U",
        left_handed(),
        WITH_GYRO.replace('"ax"', '"-ax"'),
        header="t,ax,ay,az,wx,wy,wz",
    )
    with pytest.raises(RefusedError, match=r'then acceleration = \["ax", "ay", "az"\]; if only'):
        calibrated(folder)
    turned = rows_of(table())[:, [0, 1, 3, 2, 4]] * [1, 1, 1, -1, 1]
    with pytest.raises(RefusedError, match=r'acceleration = \["-uy", "ux", "uz"\]') as refusal:
        calibrated(write_unit(tmp_path / "V", turned, AIR, header=HEADER))
    assert "left-handed" not in str(refusal.value)
    columns = AIR.replace('["ux", "uy", "uz"]', '["-uy", "ux", "uz"]')
    calibrated(write_unit(tmp_path / "W", turned, columns, header=HEADER))


def test_what_length_alone_cannot_tell_is_told_once(tmp_path: Path) -> None:
    told = findings(write_unit(tmp_path / "U", log(directions(12))))
    assert told.count("left-handed axes and with all signs reversed, so neither is detected") == 1
    rows = left_handed()
    told = findings(write_unit(tmp_path / "V", rows, WITH_GYRO, header="t,ax,ay,az,wx,wy,wz"))
    assert "the axes agree with the gyro, but three reversed signs are not detected" in told


def test_readings_that_are_no_counts_are_refused(tmp_path: Path) -> None:
    counts = COLUMNS.replace('"m/s^2"', '"count"')
    with pytest.raises(RefusedError, match=r"m/s\^2 taken for counts\? then acceleration_unit = "):
        calibrated(write_unit(tmp_path / "U", log(directions(12)), counts))


# ---- poses in a plane ----


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("normal", [0, 1, 2])
def test_poses_in_a_plane_are_called_so(tmp_path: Path, noise: float, normal: int) -> None:
    """Noise along the normal must not make the centre, and with it one orientation of all."""
    t = np.arange(0.0, 6.2, 0.5)
    flat = np.stack([np.cos(t), np.sin(t), noise * np.random.default_rng(2).standard_normal(13)])
    poses = np.roll(flat, normal + 1, axis=0).T
    rows = np.column_stack([poses @ K.T + U0])
    recording = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'
    calibration = calibrated(write_unit(tmp_path / "U", rows, recording, header="a,b,c"))
    axis = "xyz"[normal]
    assert f"13 poses lie near one plane (within {0.0:.0f}" in calibration.findings[0]
    assert f"do not determine U0{axis}: it is bounded by [priors]" in calibration.findings[0]
    sd = np.sqrt(np.diag(calibration.constants_covariance(20.0)))[9:] / 9.80665
    # The bias across the plane is bounded by its prior of 0.1 g; those in it are known.
    assert 5.0 * np.delete(sd, normal).max() < sd[normal] < 0.101
    error = calibration.thermal.constants_at(20.0)[9:] / 9.80665 - U0 / 9.80665
    assert np.abs(error / sd).max() < 4.0


# ---- pictures ----


def test_labels_have_room_however_many_poses() -> None:
    labels = [f"P{n}" for n in range(1, 401)]
    kept = with_room(labels, 2.2, 4.4)
    shown = [n for n, label in enumerate(kept) if label]
    assert [labels[n] for n in shown[:3]] == ["P10", "P20", "P30"]
    widest = max(len(labels[n]) for n in shown) * 4.4
    assert all((b - a) * 2.2 > widest for a, b in pairwise(shown))
    assert with_room(labels[:6], 17.0, 4.4) == labels[:6]
