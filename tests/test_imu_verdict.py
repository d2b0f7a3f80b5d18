"""The verdict on an IMU: sound recordings pass, contradictions do not, and nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binom, chi2

import triaxcal
from dynamic_cases import (
    UNIT_TOML,
    changed,
    held,
    mems_short,
    sheet,
    short_motion,
    table_of,
    write_unit,
)
from hand_cases import hand_short, stated
from hand_motion import HandNoise, hand_recording
from triaxcal.cli.main import main
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.limits import ImuLimits
from triaxcal.dynamic.missing import missing_effects
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.observability import observability
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.evidence.case import Case
from triaxcal.evidence.chance import chi_square, lengths, stacked
from triaxcal.evidence.check import ALARM, Evidence
from triaxcal.evidence.counts import coarse_counts
from triaxcal.evidence.examine import examine_case
from triaxcal.evidence.heldout import held_out
from triaxcal.evidence.stretches import stretches_of, without
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Move, three_axes

FAST = tuple(
    Move(angle, rate, 4.0)
    for angle, rate in (
        (360, 60), (-1440, 250), (90, 45), (720, 120), (-360, 30), (1800, 250), (-90, 60),
        (-720, 180), (450, 90),
    )
)  # fmt: skip


def examined(
    recording: ImuRecording, noise: DataSheet, limits: ImuLimits | None = None
) -> tuple[DynamicResult, Evidence]:
    result = calibrate_dynamic(recording, noise)
    off = missing_effects(recording, result)
    seen = observability(result.layout, result.covariance)
    case = Case(recording, noise, result)
    return result, examine_case(case, limits or ImuLimits(), seen, off, lambda _step, _part: None)


def failed(found: Evidence) -> set[str]:
    return {check.name for check in found.failed}


def test_the_held_out_part_is_not_used() -> None:
    """Other forces and rates in it change neither the solution without it nor its covariance."""
    truth, recording = mems_short()
    noise = sheet(truth)
    result = calibrate_dynamic(recording, noise)
    (stretch, *_) = stretches_of(result.survey)
    samples = recording.all()
    inside = (samples.time_s > stretch.before.end_s + 0.5) & (
        samples.time_s < stretch.after.start_s - 0.5
    )
    rng = np.random.default_rng(5)
    rate = samples.rate + inside[:, None] * rng.normal(0, 1e-4, samples.rate.shape)
    force = samples.force + inside[:, None] * rng.normal(0, 1e-2, samples.force.shape)
    other = held_out(Case(changed(recording, rate=rate, force=force), noise, result))
    found = held_out(Case(recording, noise, result))
    assert found is not None
    assert other is not None
    sd = np.sqrt(np.diag(found.covariance))
    # 1e-4 rad/s of noise turns the attitude it is linear about by 2e-5 rad: nothing to first order.
    np.testing.assert_allclose(other.step / sd, found.step / sd, atol=2e-3)
    y, other_y = stacked(found)[0], stacked(other)[0]
    assert np.abs(y - other_y).max() > 1e-5
    survey = without(result.survey, (stretch,))
    start = survey.windows.start_s
    middle = (start > stretch.before.end_s) & (start < stretch.after.start_s - 0.1)
    assert not survey.use[middle].any()
    assert survey.use[start < stretch.before.end_s - 0.1].all()


def test_held_out_rests_and_turns_have_the_predicted_errors() -> None:
    """Chi-square over ten units within its 99.9 % limits.

    Rests outside of a stretch are in the solution too, so that closures may be smaller than
    predicted: no lower limit for them.
    """
    values, freedom = np.zeros(2), np.zeros(2)
    for seed in range(10):
        truth = draw_truth(GRADES["mems"], seed)
        recording = held(simulate_imu(truth, short_motion(), 50.0, seed))
        case = Case(recording, sheet(truth), calibrate_dynamic(recording, sheet(truth)))
        found = held_out(case)
        assert found is not None
        y, covariance = stacked(found)
        for k, which in enumerate((lengths(y), ~lengths(y))):
            values[k] += chi_square(y, covariance, which)
            freedom[k] += which.sum()
    assert chi2.sf(values[0], freedom[0]) > 5e-4
    assert chi2.cdf(values[0], freedom[0]) > 5e-4
    assert chi2.sf(values[1], freedom[1]) > 5e-4


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["mems", "aviation"])
def test_false_alarms(grade: str) -> None:
    """At most `ALARM` of sound recordings are refused: 40 of them, with 99.9 % limits."""
    motion = short_motion() if grade == "mems" else three_axes(2.0, still_s=30.0)
    refused = 0
    for seed in range(100, 140):
        truth = draw_truth(GRADES[grade], seed)
        found = examined(held(simulate_imu(truth, motion, 50.0, seed)), sheet(truth))[1]
        refused += bool(found.failed)
    assert refused <= binom.isf(1e-3, 40, ALARM)


def _sound(motion: ImuMotion | None = None, **other: object) -> tuple[ImuRecording, DataSheet]:
    truth = draw_truth(GRADES["mems"], 3)
    motion = motion or three_axes(2.0, still_s=20.0)
    recording = held(simulate_imu(replace(truth, **other), motion, 50.0, 3))
    return recording, sheet(truth)


def _fast() -> tuple[ImuRecording, DataSheet]:
    truth = draw_truth(GRADES["mems"], 3)
    motion = three_axes(0.0, still_s=20.0, moves=FAST)
    return held(simulate_imu(truth, motion, 100.0, 5)), sheet(truth)


def _delayed() -> tuple[ImuRecording, DataSheet]:
    return _sound(accel_delay_ms=5.0)


def _two_effects() -> tuple[ImuRecording, DataSheet]:
    drift = ((30.0, 60.0, -50.0), (70.0, -40.0, 55.0), (-60.0, 45.0, 35.0))
    return _sound(accel_delay_ms=5.0, gyro_g_deg_per_h_per_g=drift)


def _beside_the_axis() -> tuple[ImuRecording, DataSheet]:
    """20 cm from the table's axis, at 60 deg/s: 0.2 m/s^2."""
    motion = three_axes(2.0, still_s=20.0)
    away = tuple(replace(m, centre_mm=(150.0, 100.0, -120.0)) for m in motion.mountings)
    return _sound(replace(motion, mountings=away))


def _nonlinear() -> tuple[ImuRecording, DataSheet]:
    recording, noise = _fast()
    rate = recording.all().rate
    bent = rate * (1 + 1e-3 * np.abs(rate) / np.radians(250.0))
    return changed(recording, rate=bent), noise


def _bent_forces() -> tuple[ImuRecording, DataSheet]:
    """By hand: at each rest the gyros read another part of the Earth's rate, which is no jump."""
    truth, recording = hand_short()
    force = recording.all().force
    return changed(recording, force=force * (1 + 2e-3 * force / 9.81)), stated(truth)


def _clipped() -> tuple[ImuRecording, DataSheet]:
    recording, noise = _fast()
    rate = recording.all().rate
    most = 0.995 * np.abs(rate).max()
    return changed(recording, rate=np.clip(rate, -most, most)), noise


def _noisier() -> tuple[ImuRecording, DataSheet]:
    recording, noise = _sound()
    third = replace(
        noise,
        gyro_arw_deg_per_sqrt_h=noise.gyro_arw_deg_per_sqrt_h / 3,
        accel_vrw_ug_per_sqrt_hz=noise.accel_vrw_ug_per_sqrt_hz / 3,
        accel_lsb=0.0,
    )
    return recording, third


def _step() -> tuple[ImuRecording, DataSheet]:
    """Half-way the biases jump: 0.05 deg/s, 20 mm/s^2."""
    recording, noise = _sound()
    samples = recording.all()
    later = (np.arange(len(samples)) > len(samples) // 2)[:, None]
    rate = samples.rate + later * np.radians(0.05)
    return changed(recording, rate=rate, force=samples.force + later * 0.02), noise


def _drift() -> tuple[ImuRecording, DataSheet]:
    """The gyros' biases drift evenly by 0.04 deg/s and less: nothing happens at any moment."""
    recording, noise = _sound()
    rate = recording.all().rate
    drift = np.linspace(0.0, np.radians(0.04), len(rate))[:, None] * np.array([1.0, -0.7, 0.8])
    return changed(recording, rate=rate + drift), noise


CONTRADICTIONS: dict[
    str, tuple[Callable[[], tuple[ImuRecording, DataSheet]], set[str], tuple[str, ...]]
] = {
    "delay of 5 ms without its block": (
        _delayed,
        {"innovations", "effects that are off"},
        ("delay of the accelerometers behind the gyros, which is switched off",),
    ),
    "two effects without their blocks": (
        _two_effects,
        {"innovations", "effects that are off"},
        ("delay of the accelerometers behind the gyros and g-dependent gyro drift together",),
    ),
    "a unit far beside the table's axis": (
        _beside_the_axis,
        {"innovations"},
        ("lever arm of the table's centre",),
    ),
    "scale nonlinearity of 1e-3": (
        _nonlinear,
        {"innovations", "held-out turns"},
        ("nonlinearity of the gyros, which is switched off",),
    ),
    "nonlinear accelerometers by hand": (
        _bent_forces,
        {"effects that are off"},
        ("nonlinearity of the accelerometers, which is switched off",),
    ),
    "noise stated too small": (
        _noisier,
        {"innovations", "held-out turns"},
        ("more noise than stated: at rest the gyros scatter by 3",),
    ),
    "biases that jump": (
        _step,
        {"innovations", "held-out rests", "held-out turns"},
        ("biases that change at",),
    ),
    "biases that drift": (
        _drift,
        {"innovations", "held-out turns"},
        ("biases that drift: the gyros at rest change slowly, by 0.02",),
    ),
}


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_contradictions_fail_and_only_what_explains_them_is_named(case: str) -> None:
    make, wrong, causes = CONTRADICTIONS[case]
    found = examined(*make())[1]
    assert wrong <= failed(found)
    assert len(found.causes) == len(causes)
    for cause, words in zip(found.causes, causes, strict=True):
        assert cause.words.startswith(words)
        assert cause.left <= 1.0


def test_turns_in_which_a_gyro_clips_are_not_used() -> None:
    """What is cut from its largest values would be a closure that fails; the rest is sound."""
    recording, noise = _clipped()
    result, found = examined(recording, noise)
    assert not found.failed
    assert any("a gyro clips at" in said for said in result.survey.findings)
    assert len(result.survey.sections) > 1


def test_noise_that_is_stated_too_large_is_a_doubt() -> None:
    """It makes every test blunt; nothing contradicts."""
    recording, noise = _sound()
    more = replace(noise, gyro_arw_deg_per_sqrt_h=3.0, accel_vrw_ug_per_sqrt_hz=1000.0)
    found = examined(recording, more)[1]
    assert not found.failed
    assert "[noise] states too much" in found.doubts[0]


@pytest.mark.parametrize(("gyro", "accel"), [(5.0, 1.0), (1.0, 5.0), (2.0, 2.0)])
def test_counts_coarser_than_the_noise_are_a_doubt(gyro: float, accel: float) -> None:
    """By hand; counts in deviations of a sample. Those of 5 leave 0.14 of a count in each rest."""
    noise = HandNoise(gyro_b=0.0, accel_b=0.0)
    per_sample = noise.gyro_n / 60 * 10, noise.accel_n * 10  # deg/s and micro-g, at 100 Hz
    coarse = replace(
        noise, gyro_lsb_deg_per_s=gyro * per_sample[0], accel_lsb=accel * per_sample[1]
    )
    _, recording = hand_recording(8, coarse, minutes=1.5)
    result = calibrate_dynamic(recording, DataSheet())
    found = coarse_counts(Case(recording, result.noise, result))
    named = [f"the {n}" for n, size in (("gyros", gyro), ("accelerometers", accel)) if size > 3]
    assert [words.split(" read ")[0] for words in found] == [f"at rest {n}" for n in named]


def test_demands_hold_what_they_say() -> None:
    """Just above the largest standard deviation, and just below it."""
    truth, recording = mems_short()
    result, found = examined(recording, sheet(truth))
    assert not found.failed
    place = result.layout.place("gyro-bias")
    largest = float((result.sd[place] / result.layout.per_unit[place]).max())
    for factor, fails in ((1.01, False), (0.99, True)):
        limits = ImuLimits(gyro_drift_sd_deg_per_h=factor * largest)
        _, again = examined(recording, sheet(truth), limits)
        assert ("[limits] gyro_drift_sd_deg_per_h" in failed(again)) == fails
    limits = ImuLimits(held_out_g=1e-7, closure_deg=1e-4)
    _, again = examined(recording, sheet(truth), limits)
    assert failed(again) == {"[limits] held_out_g", "[limits] closure_deg"}


def test_a_failed_imu_writes_nothing_and_keeps_what_was_there(tmp_path: Path) -> None:
    """Exit code 1, one line with the cause; earlier files untouched; in Python the verdict."""
    folder = write_unit(tmp_path / "IMU-A", table_of(mems_short()[1]))
    arguments = ["calib", str(folder), "--build", str(tmp_path / "build")]
    assert CliRunner().invoke(main, arguments, catch_exceptions=False).exit_code == 0
    made = tmp_path / "build" / "IMU-A"
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    text = UNIT_TOML.replace("sqrt_h = 0.3", "sqrt_h = 0.1").replace(
        "sqrt_hz = 100", "sqrt_hz = 30"
    )
    (folder / "unit.toml").write_text(text.replace("accel_lsb = 10\n", ""), encoding="utf-8")
    for command in ("calib", "dynamic"):
        with pytest.raises(triaxcal.RefusedError) as refusal:
            CliRunner().invoke(main, [command, *arguments[1:]], catch_exceptions=False)
        said = str(refusal.value)
        assert refusal.value.exit_code == 1
        assert "\n" not in said
        for words in (
            "recording.csv: innovations: 3.",
            "expected a recording that agrees with the constants found from it",
            "explained by more noise than stated",
            f"{made} keeps the files of an earlier run",
        ):
            assert words in said, said
        assert {path.name: path.read_bytes() for path in made.iterdir()} == before
    fitted = triaxcal.fit_imu(triaxcal.read_imu(folder))
    assert not fitted.passed
    assert fitted.verdict.result == "refused"
    assert fitted.verdict.words.startswith("refused: innovations: 3.")
    assert said.startswith(fitted.verdict.refused.split("; expected")[0])
    with pytest.raises(triaxcal.RefusedError, match="refused, so there is no C"):
        _ = fitted.c
    again = triaxcal.load_imu(fitted.save(tmp_path / "refused.json"))
    assert (again.passed, again.verdict) == (False, fitted.verdict)


def test_a_demand_that_is_missed_points_to_the_plan(tmp_path: Path) -> None:
    text = UNIT_TOML + "[limits]\ngyro_scale_sd_ppm = 1\n"
    folder = write_unit(tmp_path / "IMU-A", table_of(mems_short()[1]), text)
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.deliver(folder, tmp_path / "build")
    assert "[limits] gyro_scale_sd_ppm: Theta" in str(refusal.value)
    assert "% of its variance from gyro noise" in str(refusal.value)
    assert f"`triaxcal dynamic {folder} --plan` says" in str(refusal.value)
    assert not (tmp_path / "build").exists()


def test_a_file_without_a_verdict_is_not_checked(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "IMU-A", table_of(mems_short()[1]))
    fitted = triaxcal.fit_imu(triaxcal.read_imu(folder))
    assert (fitted.passed, fitted.verdict.words) == (True, "passed")
    document = json.loads(fitted.save(tmp_path / "one.json").read_text(encoding="utf-8"))
    del document["verdict"]
    (tmp_path / "old.json").write_text(json.dumps(document), encoding="utf-8")
    old = triaxcal.load_imu(tmp_path / "old.json")
    assert (old.passed, old.verdict.result) == (False, "not checked")


def test_recordings_of_two_units_are_refused_with_the_moment(tmp_path: Path) -> None:
    """Each has constants of its own; both together have none."""
    first = table_of(mems_short()[1])
    truth = draw_truth(GRADES["mems"], 77)
    second = table_of(held(simulate_imu(truth, short_motion(), 50.0, 9)))
    join_s = first[-1, 0] + 0.02 - second[0, 0]
    second[:, 0] += join_s
    folder = write_unit(tmp_path / "IMU-A", np.concatenate([first, second]))
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.deliver(folder, tmp_path / "build")
    said = str(refusal.value)
    assert "explained by constants that change at" in said
    at_s = float(said.split("change at ")[1].split(" s", maxsplit=1)[0])
    assert abs(at_s - second[0, 0]) < 5.0
    assert not (tmp_path / "build").exists()
