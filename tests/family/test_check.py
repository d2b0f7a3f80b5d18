"""`triaxcal check`: constants against a recording that was not used for them."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import COLUMNS, U0, K, csv_text, directions, log, write_unit

import triaxcal
from builds import UNITS
from triaxcal.api.field import InTheField
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.fitted import Fitted
from triaxcal.model.types import FloatArray
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.unit.description import unit_of_text

G = 9.80665


class InTheFieldOf(InTheField):
    """A calibration of which only the fit is there."""

    def __init__(self, fitted: Fitted) -> None:
        self._fitted = fitted

    @property
    def fitted(self) -> Fitted:
        return self._fitted


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A unit of 24 poses, delivered."""
    top = tmp_path_factory.mktemp("check")
    folder = write_unit(top / "units" / "U", log(directions(24)), COLUMNS)
    triaxcal.deliver(folder, top / "build")
    return top / "build"


@pytest.fixture(scope="module")
def cal(build: Path) -> triaxcal.Calibration:
    return triaxcal.load(build / "U" / "calibration.json")


def columns(
    poses: FloatArray, seed: int = 9, *, gain: FloatArray = K, bias: FloatArray = U0, **more: float
) -> dict[str, FloatArray]:
    """A new recording of a sensor with these constants."""
    rows = log(poses, seed=seed, **more)  # type: ignore[arg-type]
    force = (rows[:, 1:] - U0) @ np.linalg.inv(K).T
    readings = force @ gain.T + bias
    return {"t": rows[:, 0], **{f"a{axis}": readings[:, i] for i, axis in enumerate("xyz")}}


def file_of(folder: Path, poses: FloatArray, **more: FloatArray) -> Path:
    path = folder / "field.csv"
    path.write_text(csv_text(np.column_stack([*columns(poses, **more).values()]), "t,ax,ay,az"))  # type: ignore[arg-type]
    return path


def command(build: Path, path: Path, *more: str) -> tuple[int, str]:
    unit = build.parent / "units" / "U"
    done = CliRunner().invoke(
        main, ["check", str(unit), "--build", str(build), "--on", str(path), *more]
    )
    return done.exit_code, done.output


def test_a_new_recording_of_the_same_sensor_passes(build: Path, tmp_path: Path) -> None:
    code, text = command(build, file_of(tmp_path, directions(14, seed=4)))
    assert code == 0, text
    assert "passed       the constants agree" in text
    assert "14 poses" in text
    assert max(map(len, text.splitlines())) <= 80


def test_a_bias_that_drifted_by_2_mg_fails_and_is_named(build: Path, tmp_path: Path) -> None:
    drifted = U0 + K @ [0.0, 2e-3, 0.0]
    code, text = command(build, file_of(tmp_path, directions(14, seed=4), bias=drifted))
    assert code == 1
    line = next(line for line in text.splitlines() if line.startswith("explained"))
    assert "the bias of y changed by" in line
    assert float(line.partition("by ")[2].split()[0]) == pytest.approx(2.0, abs=0.6)
    assert "beyond" not in text.split("FAILED")[0]  # no pose is beyond 20 mg


@pytest.mark.parametrize("mg", [50.0, 150.0, -100.0])
def test_a_large_change_of_one_bias_is_named_as_well(cal: triaxcal.Calibration, mg: float) -> None:
    """|a| is not linear in it: (0.1 g)^2 / 2 across it is 5 mg, ten times the noise of a pose."""
    own_axis = U0 + np.array([0.0, mg * 1e-3 * float(np.linalg.norm(K[1])), 0.0])
    found = cal.check(columns(directions(14, seed=4), bias=own_axis)).result
    assert not found.passed
    assert len(found.explanations) == 1
    words = found.explanations[0].words
    assert "the bias of y changed by" in words
    sd = float(words.partition("(sd ")[2].rstrip(")"))
    assert float(words.partition("by ")[2].split()[0]) == pytest.approx(mg, abs=4 * sd + 0.5)
    assert found.suspicions == ()


def test_two_disturbed_poses_are_named(cal: triaxcal.Calibration) -> None:
    poses = directions(14, seed=4).copy()
    poses[8] *= 1.006
    poses[11] *= 0.992
    (only,) = cal.check(columns(poses)).result.explanations
    assert re.match(
        r"only pose 9, line \d+ \(by \+[56]\S* mg\) and pose 12, line \d+ \(by -[78]\S* mg\) were",
        only.words,
    )
    assert "the other 12 poses agree" in only.words


def test_a_limit_within_the_noise_is_not_tested(tmp_path: Path) -> None:
    """Noise of 3 mg a pose, limit 1 mg: of 14 poses several are beyond it, in a sound unit too."""
    limits = "[limits]\nat_t0_g = 0.02\nover_range_g = 0.02\n"
    rows = log(directions(24))
    folder = write_unit(tmp_path / "N", rows, COLUMNS, more=limits)
    fitted = triaxcal.fit(triaxcal.read_unit(folder)).fitted
    unit = replace(fitted.unit, limits=replace(fitted.unit.limits, at_t0_g=1e-3))
    tight = InTheFieldOf(replace(fitted, unit=unit))
    noisy = columns(directions(14, seed=4), sd=0.35)
    found = tight.check(noisy).result
    assert found.passed
    assert found.undecided.sum() >= 3
    assert "not tested" in tight.check(noisy).summary
    still = columns(directions(14, seed=4), bias=U0 + K @ [0.0, 2e-3, 0.0])
    assert tight.check(still).result.beyond.any()


def test_readings_beyond_the_codes_of_the_c_are_clamped_as_the_c_does(build: Path) -> None:
    cal = triaxcal.load(build / "U" / "calibration.json")
    code_max = cal.fitted.unit.adc.code_max * cal.fitted.unit.adc.volts_per_code
    poses = directions(6).copy()
    poses[0] *= 1.5 * code_max / (K[2, 2] + U0[2])
    study = cal.check(columns(poses))
    assert study.result.c_error_g is not None
    assert study.result.expected.error_g[0] > study.result.c_error_g[0] + 0.3
    flag = "1 of 6 poses (pose 1, line 1) have raw codes beyond"
    assert study.result.flagged[0].startswith(flag)
    assert "sets status 4" in study.summary
    assert not study.result.passed


def test_a_file_that_is_not_there(build: Path) -> None:
    unit = str(build.parent / "units" / "U")
    with pytest.raises(RefusedError, match=r"^no.csv: no such file; expected a recording; check"):
        main.main(["check", unit, "--build", str(build), "--on", "no.csv"], standalone_mode=False)


def test_a_delivered_folder_or_its_file_is_enough(build: Path, tmp_path: Path) -> None:
    generated = tmp_path / "generated"
    shutil.copytree(build / "U", generated)
    path = file_of(tmp_path, directions(8, seed=4))
    for given in (generated, generated / "calibration.json"):
        done = CliRunner().invoke(main, ["check", str(given), "--on", str(path)])
        assert done.exit_code == 0, done.output
        assert "passed" in done.output
    told = "a file; expected a unit, a delivered folder or its calibration.json"
    with pytest.raises(RefusedError, match=told):
        main.main(["check", str(path), "--on", str(path)], standalone_mode=False)


def test_columns_of_another_logger_ask_for_its_layout(build: Path, tmp_path: Path) -> None:
    path = file_of(tmp_path, directions(8, seed=4))
    path.write_text(path.read_text().replace("t,ax,ay,az", "time,X,Y,Z"))
    with pytest.raises(RefusedError, match=r"no column 't'.*another form needs its own layout"):
        triaxcal.load(build / "U" / "calibration.json").check(path)


def test_one_pose_cannot_tell_why(cal: triaxcal.Calibration) -> None:
    found = cal.check(columns(directions(1), bias=U0 + K @ [0.0, 0.0, 0.1])).result
    assert not found.passed
    assert found.suspicions == ("one pose cannot tell why",)


def test_another_sensor_fails_and_no_single_change_is_named(cal: triaxcal.Calibration) -> None:
    other = np.array([[9.71, 0.10, 0.06], [-0.09, 9.88, -0.02], [0.05, -0.07, 9.93]])
    found = cal.check(columns(directions(14, seed=4), gain=other, bias=-U0)).result
    assert not found.passed
    assert found.explanations == ()
    assert any("another unit" in words for words in found.suspicions)


def test_readings_in_g_where_the_calibration_has_metres(cal: triaxcal.Calibration) -> None:
    found = cal.check(columns(directions(14, seed=4), gain=K / G, bias=U0 / G)).result
    assert not found.passed
    assert "multiplied by 9.80665" in found.suspicions[0]


def test_codes_where_the_calibration_has_metres(cal: triaxcal.Calibration) -> None:
    """417.3 codes in a m/s^2: no factor of a unit."""
    found = cal.check(columns(directions(14, seed=4), gain=417.3 * K, bias=417.3 * U0)).result
    assert not found.passed
    assert found.explanations == ()
    (only,) = found.suspicions
    factor = float(only.partition("multiplied by ")[2].partition(":")[0])
    assert factor == pytest.approx(1.0 / 417.3, rel=0.01)


@pytest.mark.parametrize(("order", "told"), [((1, 0, 2), "y, x, z"), ((2, 0, 1), "y, z, x")])
def test_exchanged_columns_are_recognised(
    cal: triaxcal.Calibration, order: tuple[int, ...], told: str
) -> None:
    """The constants differ from axis to axis by tens of mg: only one order agrees."""
    turned = list(order)
    found = cal.check(columns(directions(14, seed=4), gain=K[turned], bias=U0[turned])).result
    assert not found.passed
    assert f"read as {told}:" in found.suspicions[0]


def test_one_bumped_pose_is_named(cal: triaxcal.Calibration) -> None:
    poses = directions(14, seed=4).copy()
    poses[8] *= 1.006
    found = cal.check(columns(poses)).result
    assert not found.passed
    assert found.explanations[0].words.startswith("only pose 9, line ")
    assert len(found.explanations) == 1


def test_another_gravity_is_stated(cal: triaxcal.Calibration) -> None:
    poses = directions(14, seed=4) * (9.832 / G)
    assert not cal.check(columns(poses)).result.passed
    assert cal.check(columns(poses), gravity_m_per_s2=9.832).result.passed
    with pytest.raises(RefusedError, match=r"gravity_m_per_s2: found 98; expected 9.7 to 9.9"):
        cal.check(columns(poses), gravity_m_per_s2=98.0)


def test_one_direction_says_what_it_cannot_show(build: Path, tmp_path: Path) -> None:
    up = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    code, text = command(build, file_of(tmp_path, up))
    assert code == 0
    assert "none of x, y, along which no pose points" in " ".join(text.split())


def test_sound_sensors_pass_and_small_drifts_are_found_as_often_as_stated(
    cal: triaxcal.Calibration,
) -> None:
    """Chance 1e-3 of a false failure; `seen_bias_g` states 95 of 100. One calibration, 25 logs."""
    passed, found = 0, 0
    for seed in range(25):
        poses = directions(12, seed=seed)
        sound = cal.check(columns(poses, seed=100 + seed)).result
        passed += sound.passed
        drift = K @ [0.0, 0.0, sound.seen_bias_g[2]]
        found += not cal.check(columns(poses, seed=200 + seed, bias=U0 + drift)).result.passed
    assert passed >= 24
    assert found >= 20  # below 20 of 25 with 95 %: once in 1e5


def test_the_integers_of_the_c_agree_with_the_model(cal: triaxcal.Calibration) -> None:
    found = cal.check(columns(directions(14, seed=4))).result
    assert found.c_error_g is not None
    lsb_g = 2.0**-cal.fitted.unit.output_q
    np.testing.assert_allclose(found.c_error_g, found.expected.error_g, atol=4 * lsb_g + 1e-6)
    assert (found.c_error_g != found.expected.error_g).all()


def test_a_column_with_another_serial_number_is_refused(build: Path, tmp_path: Path) -> None:
    path = file_of(tmp_path, directions(14, seed=4))
    lines = path.read_text().splitlines()
    for serial, refused in (("U", False), ("U-77", True)):
        own = [lines[0] + ",serial", *(f"{line},{serial}" for line in lines[1:])]
        path.write_text("\n".join(own) + "\n")
        code, _ = command(build, path)
        assert code == int(refused)
    with pytest.raises(RefusedError, match=r"column serial: serial number 'U-77'; expected 'U'"):
        triaxcal.load(build / "U" / "calibration.json").check(path)


def test_another_layout_is_stated(build: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    found = columns(directions(14, seed=4))
    rows = np.column_stack([found["t"], -found["ay"], found["ax"], found["az"]])
    path.write_text(csv_text(rows * [1.0, 1 / G, 1 / G, 1 / G], "time,u,v,w"))
    layout = tmp_path / "logger.toml"
    layout.write_text(
        '[recording]\nacceleration = ["v", "-u", "w"]\nacceleration_unit = "g"\ntime = "time"\n'
    )
    code, text = command(build, path, "--layout", str(layout))
    assert code == 0, text
    layout.write_text("[limits]\n")
    with pytest.raises(RefusedError, match=r"no table \[recording\]; expected the layout"):
        triaxcal.load(build / "U" / "calibration.json").check(path, layout=layout)


def test_a_log_that_never_rests_is_refused(cal: triaxcal.Calibration) -> None:
    t = np.arange(0.0, 40.0, 0.02)
    a = np.column_stack([np.sin(3 * t), np.cos(2.3 * t), np.sin(1.7 * t + 1)]) @ K.T + U0
    moving = {"t": t, "ax": a[:, 0], "ay": a[:, 1], "az": a[:, 2]}
    with pytest.raises(RefusedError, match="pose"):
        cal.check(moving)


def test_a_unit_that_was_not_delivered(build: Path, tmp_path: Path) -> None:
    unit = str(build.parent / "units" / "U")
    with pytest.raises(RefusedError, match=r"no such file; expected a delivered calibration; run"):
        main.main(["check", unit, "--build", str(tmp_path), "--on", "x.csv"], standalone_mode=False)


def test_poses_outside_of_the_range_are_left_out_or_refused(cal: triaxcal.Calibration) -> None:
    """The unit is calibrated at 19.5 to 20.5 degC; the log has a thermometer."""
    unit = cal.fitted.unit
    assert unit.recording is not None
    toml = unit.toml.replace('time = "t"', 'time = "t"\ntemperature = "T"')
    warm = unit_of_text("U", toml, "U")
    fitted = replace(cal.fitted, unit=replace(unit, recording=warm.recording))
    given = columns(directions(8, seed=4))
    outside = {**given, "T": np.full(len(given["t"]), 35.0)}
    with pytest.raises(RefusedError, match=r"no pose of 8 is within: 35 degC; expected 19.5 to"):
        InTheFieldOf(fitted).check(outside)
    half = {**given, "T": np.where(given["t"] < 14.0, 20.0, 35.0)}
    found = InTheFieldOf(fitted).check(half).result
    assert 2 <= len(found.poses) < 8
    assert any("outside of 19.5 to 20.5 degC and not used" in f for f in found.poses.findings)


def test_a_tilters_unit_against_its_check_positions_of_another_day(tmp_path: Path) -> None:
    unit = tmp_path / "units" / "T"
    shutil.copytree(UNITS / "AT-SIM", unit)
    triaxcal.deliver(unit, tmp_path / "build")
    cal = triaxcal.load(tmp_path / "build" / "T" / "calibration.json")
    write_simulated_unit(unit, 77)
    found = cal.check(unit / "measurements.csv").result
    assert found.passed
    assert found.chance > 1e-3
    truth = unit / "truth.toml"
    truth.write_text(truth.read_text().replace("U0x = [0.004491", "U0x = [0.005591"))  # 2 mg
    write_simulated_unit(unit, 78)
    drifted = cal.check(unit / "measurements.csv").result
    assert not drifted.passed
    assert "the bias of x changed by" in drifted.explanations[0].words
