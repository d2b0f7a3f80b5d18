"""A unit calibrated several times: what agrees, what contradicts, what repeats."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.cli.history import history as command
from triaxcal.cli.main import main
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.types import FloatArray
from triaxcal.report.history import read_history
from triaxcal.simulation.dwells import simulate
from triaxcal.simulation.truth import Imperfections, Truth, read_truth
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.uncertainty.history import (
    EN_MAX,
    Calibrated,
    changes,
    repeatability,
)
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.uncertainty import StatedUncertainty

WARNING = re.compile(
    r"warning: calibration (?P<name>\S+) contradicts (?P<before>\S+): (?P<constant>\w+) at "
    r"[-\d.]+ degC changed by (?P<by>[-+\d.]+) mg, (?P<en>[\d.]+) times the (?P<allowed>[\d.]+) mg "
    r"\(95 %\) that their uncertainties allow; the unit has aged or was damaged, or one of the two "
    r"is wrong"
)
AT_SIM = Path(__file__).resolve().parents[1] / "units" / "AT-SIM"
RIG = Imperfections(
    squareness_sd_arcsec=8.0,
    repeatability_sd_arcsec=2.0,
    level_sd_arcsec=5.0,
    gravity_sd_m_per_s2=2e-5,
    thermometer_offset_sd_degc=0.05,
)
STATED = StatedUncertainty(8.0, 2.0, 5.0, 2e-5, 0.05, 0.02)


@pytest.fixture(scope="module")
def unit() -> UnitDescription:
    thermal = ThermalChoice("polynomial", {"order": 3})
    return replace(read_unit(AT_SIM), stated=STATED, thermal=thermal, estimator="least-squares")


def calibrations(unit: UnitDescription, truths: list[Truth], seed: int) -> list[Calibrated]:
    """The unit as it is each time, each time on a rig drawn anew."""
    _, plan = read_truth(AT_SIM)
    found = []
    for k, truth in enumerate(truths):
        # Check dwells and 400 readings add nothing here but time.
        its = replace(plan, seed=1000 * seed + k, readings_per_dwell=30, check_temperatures_degc=())
        measured = simulate(unit, replace(truth, imperfections=RIG), its)
        day = date(2020 + k, 6, 1)
        found.append(Calibrated(str(day), day, measured, calibrate(unit, measured)))
    return found


def aged(truth: Truth, constant: int, by: float) -> Truth:
    """The truth with one constant moved at every temperature."""
    curves = truth.constants.curves
    coefficients = curves.coefficients.copy()
    coefficients[0, constant, 0] += by
    moved = replace(curves, coefficients=coefficients)
    return replace(truth, constants=replace(truth.constants, curves=moved))


def test_calibrations_of_one_truth_agree(unit: UnitDescription) -> None:
    """Stated: a contradiction in one of twenty. 30 pairs: more than 6 once in 1700."""
    truth, _ = read_truth(AT_SIM)
    told = sum(
        changes(unit, calibrations(unit, [truth, truth], seed))[0].contradicts for seed in range(30)
    )
    assert told <= 6


def test_an_aged_bias_contradicts_and_is_named(unit: UnitDescription) -> None:
    truth, _ = read_truth(AT_SIM)
    history = calibrations(unit, [truth, truth, aged(truth, 10, 2e-4)], 7)
    first, second = changes(unit, history)
    assert not first.contradicts
    assert second.contradicts
    assert second.en > EN_MAX
    assert second.where.startswith("U0y at")
    # 0.2 mV over a sensitivity of 0.5485 V/g; the rig's tilts add some hundredths of a mg.
    assert second.bias_mg == pytest.approx(+0.365, abs=0.1)


def test_repeatability_and_ageing(unit: UnitDescription) -> None:
    """Scale factors that grow by 100 ppm a year, over twelve calibrations a year apart."""
    truth, _ = read_truth(AT_SIM)
    kxx = float(truth.constants.curves.coefficients[0, 0, 0])
    truths = [aged(truth, 0, kxx * 1e-4 * k) for k in range(12)]
    history = calibrations(unit, truths, 11)
    found = repeatability(unit, history)
    assert found is not None
    assert found.years == pytest.approx(11.0, abs=0.01)
    # Gravity, 2 ppm, and tilts, quadratic in a few arcsec, scatter it: 3 ppm / sqrt(143) a year.
    assert found.scale_ppm_a_year == pytest.approx(100.0, abs=1.5)
    # Tilts of 8 and 5 arcsec are 24 to 55 micro-rad of cross-axis sensitivity.
    assert 15.0 < found.cross_axis_micro_rad < 80.0
    assert found.scale_ppm < 10.0


def test_too_few_calibrations_say_nothing_of_repeatability(unit: UnitDescription) -> None:
    truth, _ = read_truth(AT_SIM)
    history = calibrations(unit, [truth, truth, truth, truth], 3)
    assert repeatability(unit, history[:2]) is None
    undated = [replace(c, day=None) for c in history[:3]]
    about_mean = repeatability(unit, undated)
    assert about_mean is not None
    assert about_mean.years is None
    expected = np.array([c.calibration.thermal.constants_at(20.0)[8] for c in undated])
    assert about_mean.scale_ppm < 1e6 * float(np.ptp(expected)) / 0.5 + 20.0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A unit with two earlier calibrations; the present one is of another bias."""
    unit = tmp_path / "units" / "H-1"
    shutil.copytree(AT_SIM, unit)
    (unit / "history").mkdir()
    for day, seed in (("2024-03-30", 1), ("2025-03-30", 2)):
        write_simulated_unit(unit, seed)
        (unit / "measurements.csv").rename(unit / "history" / f"{day}.csv")
    truth = unit / "truth.toml"
    truth.write_text(truth.read_text().replace("U0x = [0.004491", "U0x = [0.004991"))
    write_simulated_unit(unit, 3)
    return unit


def test_the_command(folder: Path) -> None:
    done = CliRunner().invoke(command, [str(folder)])
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    assert lines[0].startswith("3 calibrations of AT-SIM-001")
    assert [line.split()[0] for line in lines[3:6]] == ["2024-03-30", "2025-03-30", "now"]
    told = WARNING.search(" ".join(done.output.split()))
    assert told, done.output
    assert (told["name"], told["before"]) == ("now", "2025-03-30")
    assert max(map(len, lines)) <= 80


def test_calib_tells_of_a_contradiction_with_figures(folder: Path, tmp_path: Path) -> None:
    """0.5 mV over 0.5508 V/g is 0.908 mg; noise of 1 micro-g a dwell, and curves."""
    done = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "build")])
    assert done.exit_code == 0, done.output
    told = WARNING.fullmatch(done.stderr.strip())
    assert told, done.stderr
    assert (told["name"], told["before"], told["constant"]) == ("now", "2025-03-30", "U0x")
    by, allowed = float(told["by"]), float(told["allowed"])
    assert by == pytest.approx(+0.908, abs=0.01)
    assert 0.0005 < allowed < 0.01
    assert float(told["en"]) == pytest.approx(abs(by) / allowed, rel=0.01)  # printed to 3 figures


def test_calib_is_silent_when_the_last_calibration_agrees(folder: Path, tmp_path: Path) -> None:
    newest = folder / "measurements.csv"
    newest.rename(folder / "history" / "2026-03-30.csv")
    write_simulated_unit(folder, 4)
    done = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "build")])
    assert (done.exit_code, done.stderr) == (0, "")


def test_a_broken_last_calibration_stops_calib_before_anything_is_written(
    folder: Path, tmp_path: Path
) -> None:
    (folder / "history" / "2026-03-30.csv").write_text("junk\n", encoding="utf-8")
    with pytest.raises(RefusedError, match=r"history/2026-03-30.csv, row 1 \(header\): missing"):
        main.main(["calib", str(folder), "--build", str(tmp_path / "b")], standalone_mode=False)
    assert not (tmp_path / "b").exists()


def test_a_unit_without_history(folder: Path) -> None:
    shutil.rmtree(folder / "history")
    with pytest.raises(RefusedError) as refusal:
        read_history(folder, read_unit(folder))
    assert str(refusal.value) == (
        f"{folder}/history: no earlier measurements; expected history/<day>.csv, as "
        "history/2025-03-30.csv; move measurements.csv there before you put a new one in its place"
    )


def test_a_broken_file_of_the_history_is_named(folder: Path) -> None:
    path = folder / "history" / "2024-03-30.csv"
    path.write_text(path.read_text().replace("TP3", "TP4", 1), encoding="utf-8")
    with pytest.raises(RefusedError, match=r"history/2024-03-30.csv, rows .*TP4 twice"):
        read_history(folder, read_unit(folder))


def recorded(folder: Path, name: str, poses: FloatArray, K: FloatArray, U0: FloatArray) -> None:
    """A recording of poses, one a row, with the noise of a mean of 0.1 mg."""
    seed = sum(name.encode())
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(poses.shape)
    readings = poses @ K.T + U0 + noise
    rows = [",".join(f"{v:.9g}" for v in row) for row in readings]
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("\n".join(["ax,ay,az", *rows]) + "\n", encoding="utf-8")


@pytest.fixture
def poses() -> FloatArray:
    random = np.random.default_rng(5).standard_normal((24, 3))
    return random / np.linalg.norm(random, axis=1, keepdims=True)


RECORDED = (
    'format = 1\nserial = "R-1"\n[site]\nlocal_gravity_m_per_s2 = 9.80665\n'
    '[recording]\nfile = "log.csv"\nacceleration = ["ax", "ay", "az"]\n'
    'acceleration_unit = "m/s^2"\nrows = "poses"\n'
)
GAIN = np.array([[9.85, 0.03, -0.02], [0.01, 9.79, 0.05], [-0.04, 0.02, 9.90]])
BIAS = np.array([0.21, -0.33, 0.12])


def test_recordings_are_compared_by_what_no_frame_changes(
    tmp_path: Path,
    poses: FloatArray,
) -> None:
    folder = tmp_path / "units" / "R-1"
    recorded(folder, "history/2024-03-30.csv", poses, GAIN, BIAS)
    recorded(folder, "history/2025-03-30.csv", poses[::-1], GAIN, BIAS)
    moved = BIAS + GAIN @ [0.0, 2e-3, 0.0]
    recorded(folder, "log.csv", poses, GAIN, moved)
    (folder / "unit.toml").write_text(RECORDED, encoding="utf-8")
    done = CliRunner().invoke(command, [str(folder), "--build", str(tmp_path)])
    assert done.exit_code == 0, done.output
    unit = read_unit(folder)
    first, second = changes(unit, read_history(folder, unit))
    assert not first.contradicts
    assert second.contradicts
    assert second.nine[7] == pytest.approx(2.0, abs=0.3)  # bias y, mg
    assert second.nine_where.startswith("bias y")
    assert (np.abs(second.nine[[0, 1, 2]]) < 400.0).all()
    assert "warning: calibration now contradicts 2025-03-30: " in done.output
    assert max(map(len, done.output.splitlines())) <= 80


def test_a_turned_frame_is_no_change_of_the_sensor(unit: UnitDescription) -> None:
    """The same sensor in another mounting: K R with a rotation of 2 mrad about z."""
    truth, _ = read_truth(AT_SIM)
    turn = np.array([[1.0, -2e-3, 0.0], [2e-3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    curves = truth.constants.curves
    gain = curves.coefficients[:, :9].reshape(len(curves.coefficients), 3, 3, -1)
    turned = np.einsum("mijn,jk->mikn", gain, turn).reshape(len(gain), 9, -1)
    coefficients = np.concatenate([turned, curves.coefficients[:, 9:]], axis=1)
    other = replace(
        truth,
        constants=replace(truth.constants, curves=replace(curves, coefficients=coefficients)),
    )
    (change,) = changes(unit, calibrations(unit, [truth, other], 5))
    assert abs(change.cross_axis_micro_rad) == pytest.approx(2000.0, rel=0.1)
    assert change.en > EN_MAX
    assert change.contradicts  # on a rig the mounting has changed, and that is told
    assert not change.nine_contradicts
    # The rig's own squareness of 8 arcsec, 39 micro-rad a position, is in the angles.
    assert (np.abs(change.nine[3:6]) < 200.0).all()
    (moved,) = changes(unit, calibrations(unit, [truth, aged(truth, 10, 2e-4)], 5))
    assert moved.nine_contradicts
    assert moved.nine[7] == pytest.approx(0.365, abs=0.05)  # of |k_y|: the sign of U0y


def test_an_update_in_the_field_comes_last(
    tmp_path: Path,
    poses: FloatArray,
) -> None:
    folder = tmp_path / "units" / "R-1"
    recorded(folder, "log.csv", poses, GAIN, BIAS)
    (folder / "unit.toml").write_text(RECORDED, encoding="utf-8")
    made = triaxcal.deliver(folder, tmp_path / "build")
    with pytest.raises(RefusedError, match="no earlier measurements"):
        triaxcal.compare_history(triaxcal.read_unit(folder), tmp_path / "build")
    field = tmp_path / "field"
    recorded(field, "field.csv", np.concatenate([np.eye(3), -np.eye(3)]), GAIN, BIAS)
    triaxcal.update(folder, field / "field.csv", tmp_path / "build", bias_drift_mg=2.0)
    found = triaxcal.compare_history(triaxcal.read_unit(folder), tmp_path / "build")
    (change,) = found.result
    assert (change.before, change.name) == ("now", "update")
    assert not change.contradicts
    assert f"update: calibration {_sha(made)[:8]} updated by 6 poses of field.csv." in found.summary
    # The calibration.json of that day is a part of the history like readings are.
    kept = tmp_path / "build" / f"R-1.{_sha(made)[:8]}" / "calibration.json"
    (folder / "history").mkdir()
    shutil.copy(kept, folder / "history" / "2025-01-01.json")
    first, _ = triaxcal.compare_history(triaxcal.read_unit(folder), tmp_path / "build").result
    assert (first.before, first.name, first.en) == ("2025-01-01", "now", 0.0)


def _sha(made: triaxcal.Delivered) -> str:
    assert isinstance(made.calibration, triaxcal.Calibration)
    return made.calibration.fitted.inputs_sha256
