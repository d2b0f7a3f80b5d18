"""`triaxcal update`: the delivered calibration as the prior, a few poses from the field."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import COLUMNS, U0, K, csv_text, directions, log, write_unit

import triaxcal
from builds import UNITS
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.model.framefree import frame_free, frame_free_slopes
from triaxcal.model.types import FloatArray
from triaxcal.simulation.unit import write_simulated_unit

TRUTH = directions(60, seed=77)[6:]
DRIFTED = U0 + K @ [0.0, 2e-3, 0.0]
"""The bias of y, 2 mg on."""


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A unit of 24 poses, delivered."""
    top = tmp_path_factory.mktemp("update")
    folder = write_unit(top / "units" / "U", log(directions(24)), COLUMNS)
    triaxcal.deliver(folder, top / "build")
    return top


@pytest.fixture(scope="module")
def cal(top: Path) -> triaxcal.Calibration:
    return triaxcal.load(top / "build" / "U" / "calibration.json")


def recorded(
    folder: Path, poses: FloatArray, bias: FloatArray = DRIFTED, scale: float = 1.0, seed: int = 9
) -> Path:
    rows = log(poses, seed=seed)
    rows[:, 1:] = (rows[:, 1:] - U0) * scale + bias
    path = folder / "field.csv"
    path.write_text(csv_text(rows, "t,ax,ay,az"))
    return path


def error_mg(constants: tuple[FloatArray, FloatArray], bias: FloatArray = DRIFTED) -> float:
    """Rms |a| - g at random orientations, against the truth."""
    gain, offset = constants
    force = (TRUTH @ K.T + bias - offset) @ np.linalg.inv(gain).T
    return 1e3 * float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) - 1.0) ** 2)))


def test_six_poses_recover_a_bias_that_drifted_by_2_mg(
    top: Path, cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    done = triaxcal.update(
        top / "units" / "U", recorded(tmp_path, directions(6)), top / "build", into=tmp_path
    )
    assert isinstance(done.calibration, triaxcal.Calibration)
    assert error_mg(cal.constants(20.0)) > 0.9
    assert error_mg(done.calibration.constants(20.0)) < 0.4
    found = done.calibration.fitted.calibration
    change = (found.thermal.constants_at(20.0) - cal.fitted.calibration.thermal.constants_at(20.0))[
        9:
    ]
    by_mg = 1e3 * np.linalg.solve(K, change)
    # A pose's noise is some 0.3 mg, a bias of two opposite poses 0.2 mg.
    np.testing.assert_allclose(by_mg, [0.0, 2.0, 0.0], atol=0.7)
    assert {"triax_calib.h", "triax_calib.bin", "passport.html"} <= set(done.files)
    firmware = triaxcal.firmware(done.calibration)
    assert (tmp_path / "U" / "triax_calib.bin").read_bytes() == firmware.files["triax_calib.bin"]


def test_two_poses_lower_the_error_and_leave_the_rest(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    along_y = directions(6)[[1, 3]]
    found = cal.update(recorded(tmp_path, along_y)).result
    gain, offset = (
        found.calibration.thermal.constants_at(20.0)[:9].reshape(3, 3),
        found.calibration.thermal.constants_at(20.0)[9:],
    )
    assert error_mg((gain, offset)) < 0.5 * error_mg(cal.constants(20.0))
    changed = np.abs(found.after - found.before)
    # y's bias and sensitivity are seen; all else moves by less than a tenth of its uncertainty.
    others = [k for k in range(9) if k not in (1, 7)]
    assert (changed[others] < 0.1 * found.sd_before[others]).all()
    assert (found.sd_after <= found.sd_allowed * (1 + 1e-9)).all()
    assert {"bias x", "bias z", "sensitivity x", "sensitivity z"} <= set(found.unseen)
    assert "bias y" not in found.unseen


def test_what_one_direction_leaves_unknown_is_said(top: Path, tmp_path: Path) -> None:
    up = directions(6)[[0]]
    drifted = recorded(tmp_path, up, bias=U0 + K @ [0.0, 0.0, 5e-3])
    done = triaxcal.update(top / "units" / "U", drifted, top / "build", into=tmp_path)
    text = " ".join(done.summary.split())
    assert "the update says next to nothing of sensitivity x, sensitivity y" in text
    assert "|a| shows no rotation of the axes" in text
    # Bias and scale of z act alike in one pose: the uncertainty says so.
    assert "bias z 0" not in text


def test_a_contradiction_is_refused_and_nothing_is_written(top: Path, tmp_path: Path) -> None:
    before = {p: p.read_bytes() for p in (top / "build").rglob("*") if p.is_file()}
    path = recorded(tmp_path, directions(6), bias=U0, scale=1.05)
    unit = str(top / "units" / "U")
    with pytest.raises(RefusedError) as refusal:
        main.main(
            ["update", unit, "--build", str(top / "build"), "--with", str(path)],
            standalone_mode=False,
        )
    told = "contradict the delivered calibration beyond its uncertainty and the drift: chi-square"
    assert told in refusal.value.found
    assert "they agree if all scales, or local gravity, changed by +4.9" in refusal.value.found
    assert "a drift of 10 mg of the biases and 2.5e+03 ppm" in refusal.value.expected
    assert {p: p.read_bytes() for p in (top / "build").rglob("*") if p.is_file()} == before


def test_one_bumped_pose_of_six_is_named(cal: triaxcal.Calibration, tmp_path: Path) -> None:
    poses = directions(6).copy()
    poses[3] *= 1.02
    path = recorded(tmp_path, poses, bias=U0)
    alone = r"only pose 4, line 6\d\d \(by \+[12]\S* mg\) was disturbed; the other 5 poses agree"
    with pytest.raises(RefusedError, match=alone):
        cal.update(path, bias_drift_mg=1.0)


def test_a_larger_drift_is_allowed_for_where_it_is_stated(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    path = recorded(tmp_path, directions(6))
    with pytest.raises(RefusedError, match="contradict"):
        cal.update(path, bias_drift_mg=0.05, scale_drift_ppm=50, axes_drift_micro_rad=20)
    assert cal.update(path, bias_drift_mg=2.0).result.share[7] > 0.8
    with pytest.raises(RefusedError, match="bias_drift_mg: found 0; expected a number above 0"):
        cal.update(path, bias_drift_mg=0)


def test_the_command_keeps_the_files_before_and_their_hash(top: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    shutil.copytree(top / "build", build)
    unit = str(top / "units" / "U")
    first = json.loads((build / "U" / "calibration.json").read_bytes())["inputs_sha256"]
    for n in range(2):
        path = recorded(tmp_path, directions(6), seed=30 + n)
        given = ["update", unit, "--build", str(build), "--with", str(path)]
        done = CliRunner().invoke(main, [*given, "--bias-drift", "2"])
        assert done.exit_code == 0, done.output
        assert "the files before are kept in" in " ".join(done.output.split())
        # A path is as long as it is, and is not cut.
        lines = [line for line in done.output.splitlines() if str(tmp_path) not in line]
        assert max(map(len, lines)) <= 80
    document = json.loads((build / "U" / "calibration.json").read_bytes())
    second = document["update"]["parents"][1]
    assert document["update"]["parents"] == [first, second]
    assert document["inputs_sha256"] not in (first, second)
    assert document["update"]["poses"] == 6
    names = sorted(p.name for p in build.iterdir())
    assert names == sorted(["U", f"U.{first[:8]}", f"U.{second[:8]}"])
    kept = build / f"U.{first[:8]}" / "calibration.json"
    assert kept.read_bytes() == (top / "build" / "U" / "calibration.json").read_bytes()
    # Two updates of six poses know more than one: and the file is loaded whole.
    cal = triaxcal.load(build / "U" / "calibration.json")
    assert error_mg(cal.constants(20.0)) < 0.4
    assert cal.uncertainty(20.0).expanded > 0.0


def test_a_log_that_never_rests_is_refused(cal: triaxcal.Calibration) -> None:
    t = np.arange(0.0, 40.0, 0.02)
    a = np.column_stack([np.sin(3 * t), np.cos(2.3 * t), np.sin(1.7 * t + 1)]) @ K.T + U0
    with pytest.raises(RefusedError, match="pose"):
        cal.update({"t": t, "ax": a[:, 0], "ay": a[:, 1], "az": a[:, 2]})


def test_a_tilters_unit_is_updated_by_its_check_positions(tmp_path: Path) -> None:
    unit = tmp_path / "units" / "T"
    shutil.copytree(UNITS / "AT-SIM", unit)
    triaxcal.deliver(unit, tmp_path / "build")
    truth = unit / "truth.toml"
    truth.write_text(truth.read_text().replace("U0x = [0.004491", "U0x = [0.004766"))  # -0.5 mg
    write_simulated_unit(unit, 78)
    fresh = tmp_path / "fresh.csv"
    lines = (unit / "measurements.csv").read_text().splitlines()
    fresh.write_text("\n".join(lines[:2] + lines[20:26]) + "\n")  # six dwells of one temperature
    before = triaxcal.load(tmp_path / "build" / "T" / "calibration.json")
    done = triaxcal.update(unit, fresh, tmp_path / "build", into=tmp_path / "out")
    assert isinstance(done.calibration, triaxcal.Calibration)
    truth_at = triaxcal.fit(triaxcal.read_unit(unit)).constants(20.0)[1]
    errors = [np.abs(c.constants(20.0)[1] - truth_at).max() for c in (before, done.calibration)]
    assert errors[0] == pytest.approx(2.75e-4, rel=0.05)
    assert errors[1] < 0.1 * errors[0]
    assert triaxcal.load(done.folder / "calibration.json").verdict.passed


def test_a_column_with_a_minus_is_updated_with_its_sign(tmp_path: Path) -> None:
    turned = COLUMNS.replace('"ay"', '"-ay"')
    rows = log(directions(24))
    rows[:, 2] *= -1.0
    cal = triaxcal.fit(triaxcal.read_unit(write_unit(tmp_path / "U", rows, turned)))
    rows = log(directions(6), seed=9)
    rows[:, 1:] += DRIFTED - U0
    rows[:, 2] *= -1.0
    found = cal.update(
        {"t": rows[:, 0], **dict(zip(("ax", "ay", "az"), rows[:, 1:].T, strict=True))}
    ).result
    change = 1e3 * (found.after - found.before)[6:]
    np.testing.assert_allclose(change, [0.0, -2.0, 0.0], atol=0.7)  # of the converter's own y


def test_nine_constants_that_no_rotation_changes() -> None:
    constants = np.concatenate([K.ravel(), U0])
    angle = 0.3
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
    )
    turned = np.concatenate([(K @ turn).ravel(), U0])
    nine = frame_free(constants)
    np.testing.assert_allclose(frame_free(turned), nine, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(nine[6:], U0 / np.linalg.norm(K, axis=1))
    # x and y stand at 90 deg less the sum of Kxy / Kxx and Kyx / Kyy, to first order.
    assert nine[3] == pytest.approx(-(0.03 / 9.85 + 0.01 / 9.79), rel=2e-2)
    slopes = frame_free_slopes(constants)
    step = np.zeros(12)
    step[4] = 1e-3
    np.testing.assert_allclose(frame_free(constants + step) - nine, slopes @ step, atol=1e-7)


def test_calib_keeps_an_update_that_it_replaces(top: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    shutil.copytree(top / "build", build)
    unit = top / "units" / "U"
    triaxcal.update(unit, recorded(tmp_path, directions(6)), build)
    updated = (build / "U" / "calibration.json").read_bytes()
    first = (top / "build" / "U" / "calibration.json").read_bytes()
    inputs = json.loads(updated)["inputs_sha256"]
    again = triaxcal.deliver(unit, build)
    assert (build / "U" / "calibration.json").read_bytes() == first
    kept = build / f"U.{inputs[:8]}"
    assert (kept / "calibration.json").read_bytes() == updated
    assert f"is kept in {kept}/" in again.summary
    assert "is kept in" not in triaxcal.deliver(unit, build).summary  # no update is there now
    history = triaxcal.compare_history(triaxcal.read_unit(unit), build)
    assert [(c.before, c.name) for c in history.result] == [("now", f"update {inputs[:8]}")]
    assert "are not independent" in history.summary
    assert "Repeatability: unknown" in history.summary


def test_a_delivered_folder_is_updated_without_the_unit(top: Path, tmp_path: Path) -> None:
    generated = tmp_path / "generated"
    shutil.copytree(top / "build" / "U", generated)
    before = (generated / "calibration.json").read_bytes()
    path = recorded(tmp_path, directions(6))
    given = ["update", str(generated / "calibration.json"), "--with", str(path)]
    done = CliRunner().invoke(main, given)
    assert done.exit_code == 0, done.output
    sha = json.loads(before)["inputs_sha256"][:8]
    assert (tmp_path / f"generated.{sha}" / "calibration.json").read_bytes() == before
    cal = triaxcal.load(generated / "calibration.json")
    assert error_mg(cal.constants(20.0)) < 0.4
    into = tmp_path / "out"
    more = recorded(tmp_path, directions(6), bias=DRIFTED + K @ [3e-3, 0.0, 0.0], seed=33)
    triaxcal.update(generated, more, into=into)
    assert (into / "U" / "triax_calib.bin").is_file()


def test_a_result_prints_as_its_text(cal: triaxcal.Calibration, tmp_path: Path) -> None:
    found = cal.update(recorded(tmp_path, directions(6)))
    assert str(found) == found.summary
    assert repr(found) == f"<Study of FieldUpdate>\n{found.summary}"


def test_data_that_the_calibration_has_seen_are_no_update(
    top: Path, cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    own = top / "units" / "U" / "log.csv"
    with pytest.raises(RefusedError, match=r"24 of 24 poses are those that the calibration was"):
        cal.update(own)
    with pytest.raises(RefusedError, match=r"24 of 24 poses are those that the calibration was"):
        cal.check(own)
    build = tmp_path / "build"
    shutil.copytree(top / "build", build)
    first = recorded(tmp_path, directions(6))
    triaxcal.update(top / "units" / "U", first, build)
    with pytest.raises(RefusedError, match="was updated by this recording already"):
        triaxcal.update(top / "units" / "U", first, build)
    again = tmp_path / "again"
    again.mkdir()
    more = recorded(again, directions(6), seed=31)
    triaxcal.update(top / "units" / "U", more, build, bias_drift_mg=2.0)
    with pytest.raises(RefusedError, match="was updated by this recording already"):
        triaxcal.update(top / "units" / "U", first, build)
    cal.check(recorded(tmp_path, directions(6), seed=32))


@pytest.mark.parametrize("faces", [[0], [0, 2, 0], [0, 1, 2, 3, 4, 5]])
def test_an_update_that_tells_less_than_the_calibration_is_refused(
    top: Path, tmp_path: Path, faces: list[int]
) -> None:
    """Poses that agree, with a drift that nobody has stated: 24 poses know more than a few."""
    before = {p: p.read_bytes() for p in (top / "build").rglob("*") if p.is_file()}
    path = recorded(tmp_path, directions(6)[faces], bias=U0)
    told = "in agreement with the delivered calibration, which knows more: "
    with pytest.raises(RefusedError, match=told):
        triaxcal.update(top / "units" / "U", path, top / "build")
    assert {p: p.read_bytes() for p in (top / "build").rglob("*") if p.is_file()} == before


def test_a_stated_drift_is_what_an_update_is_compared_with(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    path = recorded(tmp_path, directions(6), bias=U0)
    found = cal.update(path, bias_drift_mg=10.0).result
    assert found.length_after_g < 0.2 * found.length_allowed_g
    assert found.length_allowed_g > 5.0 * found.length_before_g
    one = recorded(tmp_path, directions(6)[[0]], bias=U0)
    with pytest.raises(RefusedError, match=r"1 pose tell too little: .* by \+-0\.[89]"):
        cal.update(one, bias_drift_mg=0.01, scale_drift_ppm=1, axes_drift_micro_rad=1)


def test_a_drift_of_50_mg_is_no_contradiction_where_it_is_stated(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    """Across the bias |a| moves by its square: 1.8 mg at 60 mg, six times the noise of a pose."""
    moved = U0 + K @ [0.0, 60e-3, 0.0]
    found = cal.update(recorded(tmp_path, directions(12), bias=moved), bias_drift_mg=30.0).result
    assert found.chi_square < 30.0  # of 12
    np.testing.assert_allclose(1e3 * (found.after - found.before)[6:], [0, 60, 0], atol=1.5)


def test_a_refused_option_is_named_as_it_was_typed(top: Path, tmp_path: Path) -> None:
    path = recorded(tmp_path, directions(6))
    given = [str(top / "units" / "U"), "--build", str(top / "build")]
    for command, option, value in (
        (["update", *given, "--with"], "--gravity", "978"),
        (["check", *given, "--on"], "--gravity", "978"),
    ):
        with pytest.raises(RefusedError, match=f"^{option}: found {value}; expected"):
            main.main([*command, str(path), option, value], standalone_mode=False)
    mistyped = ["update", *given, "--with", str(path), "--bias-drift", "0"]
    done = CliRunner().invoke(main, mistyped)
    assert done.exit_code == 2
    assert "Invalid value for '--bias-drift'" in done.output


def test_a_delivered_update_says_each_finding_once(top: Path, tmp_path: Path) -> None:
    path = recorded(tmp_path, directions(6))
    done = triaxcal.update(top / "units" / "U", path, top / "build", into=tmp_path / "out")
    findings = [line for line in done.summary.splitlines() if line.startswith("found ")]
    assert len(findings) == len({line.split(maxsplit=1)[1] for line in findings}) >= 2
    study = triaxcal.load(top / "build" / "U" / "calibration.json").update(path)
    assert "found        |a| shows no rotation" in study.summary
