"""From a unit's recording to the compiled C of both triads, against the simulator's truth."""

from __future__ import annotations

import hashlib
import html
import json
import re
import shutil
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import wrapped
from triaxcal.cli.main import main
from triaxcal.codegen.routines import GeneratedImu, start_generated_imu
from triaxcal.delivery import imu as imudelivery
from triaxcal.delivery import imuc
from triaxcal.delivery.imu import ImuDelivery, deliver_imu
from triaxcal.delivery.imuc import ImuC
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.imumodel import imu_model
from triaxcal.evidence.check import Check
from triaxcal.model.methods.imu import ImuModel, compensate_imu
from triaxcal.model.metrological import unpack_constants
from triaxcal.report.dynamic import dynamic_files, dynamic_summary
from triaxcal.report.dynamicpage import digits, dynamic_page
from triaxcal.report.stated.words import label
from triaxcal.report.texts.speaker import speaker
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.unit.measured import MEASURED, Measured
from triaxcal.unit.passport import ENGLISH

SIM = Path(__file__).parent.parent / "units" / "IMU-SIM"
STANDARD_G = 9.80665
LOCAL_G = 9.8107
DEG_PER_H = np.deg2rad(1.0) / 3600
REFERENCE_DEGC = 20.0
FREE = slice(100)
"""Samples without force: D11 + D22 + D33 is hardly seen on a turntable."""


@dataclass(frozen=True)
class Ran:
    """One run of the command: what it printed, what it wrote, what it knew."""

    output: str
    folder: Path
    made: ImuDelivery
    c: ImuC
    generated: GeneratedImu


def copied(folder: Path, minutes: str = "1.5") -> Path:
    shutil.copytree(SIM, folder, ignore=shutil.ignore_patterns("recording.csv"))
    change(folder, "imu_truth.toml", "minutes_per_axis = 4", f"minutes_per_axis = {minutes}")
    return folder


def change(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new), encoding="utf-8")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    base = tmp_path_factory.mktemp("imu")
    unit = copied(base / "IMU-SIM")
    change(unit, "unit.toml", "0.0078125", "0.125")  # fewer temperature codes to visit
    write_simulated_unit(unit)
    seen: list[ImuDelivery] = []

    def watched(*arguments: object) -> ImuDelivery:
        seen.append(deliver_imu(*arguments))  # type: ignore[arg-type]
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imudelivery, "deliver_imu", watched)
        arguments = ["calib", str(unit), "--build", str(base / "build")]
        done = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    folder, objects = base / "build" / "IMU-SIM", base / "objects"
    objects.mkdir()
    library = start_generated_imu(folder, objects).load()
    c = seen[0].c
    assert c is not None
    return Ran(done.output, folder, seen[0], c, GeneratedImu(library))


def sha256_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def exact(model: ImuModel, accel_g: np.ndarray, gyro: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K^-1 (U - U0) of both triads at 20 degC, and -G a."""
    K, U0 = unpack_constants(model.accel.constants_at(REFERENCE_DEGC))
    force = np.linalg.solve(K, (accel_g - U0).T).T
    K, U0 = unpack_constants(model.gyro.constants_at(REFERENCE_DEGC))
    return force, np.linalg.solve(K, (gyro - U0).T).T - force @ model.g_sensitivity.T


def samples(ran: Ran) -> tuple[np.ndarray, ...]:
    """True force (g) and rate (rad/s), codes of both triads, what the compiled C makes of them."""
    rng = np.random.default_rng(11)
    force, rate = rng.uniform(-8, 8, (200, 3)), np.deg2rad(rng.uniform(-400, 400, (200, 3)))
    force[FREE] = 0.0
    truth = draw_truth(MEMS, 20240229, ("delay", "g-drift"))
    bias = 1e-3 * np.array(truth.accel_bias_mm_per_s2) / STANDARD_G
    accel_reading = force + force @ truth.accel_matrix().T + bias
    drift = DEG_PER_H * np.array(truth.gyro_g_deg_per_h_per_g)  # for one local g
    gyro_reading = rate + rate @ truth.gyro_matrix().T
    gyro_reading += force @ drift.T * (STANDARD_G / LOCAL_G)
    gyro_reading += DEG_PER_H * np.array(truth.gyro_bias_deg_per_h)
    device = ran.c.device
    raw_accel = np.rint(accel_reading / device.accel_adc.volts_per_code).astype(np.int32)
    raw_gyro = np.rint(gyro_reading / device.gyro_adc.volts_per_code).astype(np.int32)
    temp = np.full(200, device.temperature_sensor.code(REFERENCE_DEGC), np.int32)
    _, (accel, turned, status) = ran.generated.run(None, temp, raw_accel, raw_gyro)
    assert not status.any()
    found = accel * 2.0**-device.accel_q, np.deg2rad(turned * 2.0**-device.gyro_rate_q)
    return force, rate, raw_accel, raw_gyro, *found


def allowed(c: ImuC) -> tuple[float, float]:
    """Proven bounds and model errors, g and rad/s; some rounding of doubles is far below."""
    accel = max(c.build.accel_bound.per_axis_lsb) * 2.0**-c.device.accel_q + c.accel_model_error_g
    gyro = np.deg2rad(max(c.build.rate_bound_lsb) * 2.0**-c.device.gyro_rate_q)
    # 16 g, 10 rad/s in doubles, some hundred operations: 1e-13.
    return accel + 1e-12, float(gyro + c.gyro_model_error_deg_per_h * DEG_PER_H + 1e-12)


def test_the_compiled_c_is_the_fitted_model_within_the_proven_bounds(ran: Ran) -> None:
    _, _, raw_accel, raw_gyro, accel, rate = samples(ran)
    device = ran.c.device
    readings = (
        raw_accel * device.accel_adc.volts_per_code,
        raw_gyro * device.gyro_adc.volts_per_code,
    )
    expected = exact(ran.c.model, *readings)
    for found, wanted, most in zip((accel, rate), expected, allowed(ran.c), strict=True):
        error = np.abs(found - wanted).max()
        assert 0.1 * most < error <= most


def test_the_compiled_c_gives_the_true_force_and_rate(ran: Ran) -> None:
    """Within 5 sd of the constants, half a code, and the proven bound."""
    force, rate, raw_accel, raw_gyro, accel, turned = samples(ran)
    device, result = ran.c.device, ran.made.done.result
    lsb = device.accel_adc.volts_per_code, device.gyro_adc.volts_per_code
    readings = raw_accel * lsb[0], raw_gyro * lsb[1]
    base = exact(ran.c.model, *readings)
    slopes = []
    for i, sd in enumerate(result.sd):
        p = result.p.copy()
        p[i] += sd
        moved = exact(imu_model(replace(result, p=p), device.range_degc), *readings)
        slopes.append([(m - b) / sd for m, b in zip(moved, base, strict=True)])
    for k, (true, found) in enumerate(((force, accel), (rate, turned))):
        J = np.stack([s[k] for s in slopes], axis=-1)
        sd = np.sqrt(np.einsum("nai,ij,naj->na", J, result.covariance, J))
        # |K^-1| rows sum to less than 1.1 (errors of 1 %); the force's half code through G is less
        # than a hundredth of the rate's.
        most = 5 * sd + 0.55 * lsb[k] * 1.01 + allowed(ran.c)[k]
        error = np.abs(found - true)
        assert (error <= most).all()
        assert np.median(np.abs(readings[k] - true)[FREE]) > 20 * np.median(error[FREE])


def test_what_is_written_and_said(ran: Ran) -> None:
    names = {path.name for path in ran.folder.iterdir()}
    assert names == {
        "calibration.json",
        "dynamic.html",
        "triax_calib.a2l",
        "verification.json",
        *ran.made.c.build.files,
    }
    build = ran.c.build
    checked = build.accel_check.total + build.gyro_check.total + build.vectors
    accel, gyro = build.accel_bound.lsb, max(build.rate_bound_lsb)
    accel_words = f"{accel:.3f} LSB, {accel * 2.0**-24 * 1e6:.3g} micro-g,"
    gyro_words = f"{gyro:.3f} LSB, {gyro * 2.0**-19 * 3600:.3g} deg/h,"
    for line in (
        "C               both triads, -40 to 85 degC, 1 001 temperature codes",
        f"  accelerometer LSB 2^-24 g; proven within {accel_words}",
        f"  gyro          LSB 2^-19 deg/s; proven within {gyro_words}",
        f"  checked       {checked:,} vectors: Python".replace(",", " "),
        "  not corrected delay of the accelerometers behind the gyros",
        "  constant      gyro over temperature: [dynamic] blocks has no\n",
        '                "gyro-thermal"\n',
    ):
        assert line in ran.output
    summary = dynamic_summary(ran.made, dynamic_files(ran.made), "build/IMU-SIM")
    assert max(map(len, wrapped(summary, 80).splitlines())) <= 80
    stated = json.loads((ran.folder / "verification.json").read_text(encoding="utf-8"))
    assert stated["accelerometer"]["bound_lsb"] == accel
    total = accel * 2.0**-24 + ran.c.accel_model_error_g
    assert stated["accelerometer"]["error_g"] == pytest.approx(total)
    assert f"of the fitted model: together {total * 1e6:.3g} micro-g" in ran.output
    total = gyro * 2.0**-19 * 3600 + ran.c.gyro_model_error_deg_per_h
    assert stated["gyro"]["error_deg_per_h"] == pytest.approx(total)
    assert f"of the fitted model: together {total:.3g} deg/h" in ran.output
    fitted = json.loads((ran.folder / "calibration.json").read_text(encoding="utf-8"))
    assert "angles" not in fitted["firmware"]["device"]  # as before there were any
    assert "angles" not in stated
    files = ran.made.done.unit.path, ran.made.done.unit.recording
    digests = b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)
    assert fitted["inputs_sha256"] == stated["inputs_sha256"] == hashlib.sha256(digests).hexdigest()
    page = (ran.folder / "dynamic.html").read_text(encoding="utf-8")
    for name in (*build.files, *map(sha256_of, build.files.values())):
        assert name in page
    assert f"≤ {accel:.3f} LSB" in page
    assert f"carried over from the accelerometer ≤ {gyro:.3f} LSB" in page
    assert "not run on this delivery (triaxcal verify)" in page
    assert stated["gyro"]["with_accelerometer_lsb"] == list(build.rate_bound_lsb)
    header = (ran.folder / "triax_calib.h").read_text(encoding="utf-8")
    assert f"inputs sha256 {stated['inputs_sha256'][:16]}." in header
    assert "accelerometer code: 21 bits for 10.48576 g full scale" in header
    assert "not corrected: delay of the accelerometers behind the gyros" in header
    assert ran.made.verdict.result == "passed"
    assert "* verdict: passed\n" in header
    assert "held-out rests: |a| - g of " in header
    said = fitted["verdict"]
    assert (said["result"], said["passed"], said["words"]) == ("passed", True, "passed")
    assert [c["name"] for c in said["checks"]][:3] == [
        "innovations",
        "held-out rests",
        "held-out turns",
    ]
    assert "verdict         passed\n" in ran.output
    for check in said["checks"]:
        assert check["held"]
        assert f"<td>{html.escape(check['words'])}</td><td>passed</td>" in page


def test_a_file_keeps_its_name_and_a_constant_has_one(ran: Ran) -> None:
    done = ran.made.done
    renamed = replace(done.unit, recordings=(replace(done.unit.recordings[0], file="a_b_c.csv"),))
    check = Check(
        "rests alone", True, "Gamma21 differs, Gamma2 and xGamma21 do not", 1.0, 3.0, "", 1
    )
    evidence = replace(ran.made.evidence, checks=(check,))
    made = replace(ran.made, done=replace(done, unit=renamed), evidence=evidence)
    assert "recording       a_b_c.csv: " in dynamic_summary(made, ["a"], "build")
    page = html.unescape(dynamic_page(made, {}).decode())
    assert (
        "<td>misalignment of accelerometer y about z differs, Gamma2 and xGamma21 do not</td>"
        in page
    )
    rests = done.result.survey.rests
    assert f'<p class="note">{len(rests)} rests of ' in page


def test_the_page_warns_of_what_was_left_out(ran: Ran) -> None:
    """An effect that shows, what was not tested, and what was left in doubt."""
    made, (first, *others) = ran.made, ran.made.done.off
    page = dynamic_page(made, {}).decode()
    assert '<div class="badge"><b>PASSED</b><small>innovations ' in page
    assert '<p class="warning">' not in page
    shown = replace(made.done, off=(replace(first, shown=True, moves_sd=0.6), *others))
    page = html.unescape(dynamic_page(replace(made, done=shown), {}).decode())
    assert (
        f"The recording shows an effect that is switched off, {first.title}: it would move no "
        "constant by more than 0.6 standard deviations. Switch on "
        f'"{first.name}" in [dynamic] blocks.</p>'
    ) in page
    small = replace(made.done, off=(replace(first, shown=True, moves_sd=0.4), *others))
    page = html.unescape(dynamic_page(replace(made, done=small), {}).decode())
    assert '<p class="warning">' not in page
    advice = "moves no constant by more than 0.4 standard deviations; it may stay off"
    assert f'<b class="notok">significant</b>: {advice}' in page
    assert advice in dynamic_summary(replace(made, done=small), ["a"], "build")
    untested = replace(made.evidence, not_tested=("D11 not observable",))
    page = dynamic_page(replace(made, evidence=untested), {}).decode()
    assert '<div class="badge"><b>PASSED ON THE RECORDING</b>' in page
    assert '<p class="warning">D11 not observable.</p>' in page
    blunt = replace(made.evidence, doubts=("the noise is stated too large",))
    page = dynamic_page(replace(made, evidence=blunt), {}).decode()
    assert '<div class="badge warn"><b>NOT SHOWN</b>' in page
    assert "Not shown to be right: the noise is stated too large.</p>" in page


def test_the_page_calls_constants_by_names_for_people(ran: Ran) -> None:
    """And a value's ± is its expanded uncertainty, 1.96 standard deviations."""
    result = ran.made.done.result
    page = dynamic_page(ran.made, {}).decode()
    for state in result.layout.states:
        assert f'<div class="head">{html.escape(state.label)}<span>' in page
        assert f">{state.name}<" not in page
    labels = [state.label for state in result.layout.states]
    assert "misalignment of accelerometer y about z" in labels
    assert len(set(labels)) == len(labels)
    state, sd = result.layout.states[0], result.sd[0]
    (shown,) = re.findall(rf"<title>{state.label}: \S+ ± (\S+) ", page)
    assert float(shown) == pytest.approx(1.96 * sd / state.per_unit, rel=0.05)  # two digits


def test_page_and_json_say_when_and_where_it_was_measured(ran: Ran) -> None:
    stated = Measured(
        "table 2",
        date(2026, 3, 30),
        "room <7>",
        "O. O.",
        (21.5, 23.0),
        (40.0, 45.0),
        (1001.0, 1001.0),
    )
    unit = replace(ran.made.done.unit, measured=stated)
    made = replace(ran.made, done=replace(ran.made.done, unit=unit))
    page = html.unescape(dynamic_page(made, {}).decode())
    words = (
        "table 2",
        "2026-03-30",
        "room <7>",
        "O. O.",
        "21.5 to 23 °C",
        "40 to 45 %",
        "1001 hPa",
    )
    t = speaker(ENGLISH)
    for key, text in zip(MEASURED.keys, words, strict=True):
        assert f"<dt>{label(f'measured.{key.name}', t)}</dt><dd>{text}</dd>" in page
    found = json.loads(dynamic_files(made)["calibration.json"])["measured"]
    assert list(found) == [key.name for key in MEASURED.keys]
    assert (found["date"], found["ambient_degc"]) == ("2026-03-30", [21.5, 23.0])


@pytest.mark.parametrize(
    ("value", "sd", "text"), [(-0.3, 108.0, "0"), (-7.4, 98.0, "-7"), (1.23456, 0.021, "1.235")]
)
def test_digits(value: float, sd: float, text: str) -> None:
    assert digits(value, sd) == text


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "accel_bits = 21\n",
            "",
            "missing: [device] accel_bits (or leave [device] out)",
        ),
        (
            "accel_bits = 21",
            "accel_bits = 21.5",
            "[device] accel_bits: found 21.5; expected a whole number from 8 to 32",
        ),
        (
            "[-40, 85]",
            "[85, -40]",
            "range_degc: found [85, -40]; expected a list of 2 rising numbers from -200 to 400",
        ),
        (
            "gyro_bits",
            "gyro_bit = 3\ngyro_bits",
            'unknown: [device] gyro_bit (did you mean "gyro_bits"?)',
        ),
        (
            "range_degc",
            "accel_q = 40\nrange_degc",
            "[device] accel_q: found 40; expected a whole number from 8 to 30",
        ),
    ],
)
def test_a_wrong_device_is_refused(tmp_path: Path, old: str, new: str, text: str) -> None:
    unit = copied(tmp_path / "IMU-SIM")
    change(unit, "unit.toml", old, new)
    with pytest.raises(RefusedError) as refusal:
        read_dynamic(unit)
    assert str(refusal.value).startswith(f"{unit / 'unit.toml'}")
    assert str(refusal.value).endswith(text)


def test_functions_too_far_from_the_model_are_refused(ran: Ran) -> None:
    """A scale factor of 40 % at one end and 165 % at the other: no N(T) of order 9 follows."""
    device, model, unit = ran.c.device, ran.c.model, ran.made.done.unit
    coefficients = model.accel.curves.coefficients.copy()
    coefficients[0, [0, 4, 8], 1] = 0.01
    curves = replace(model.accel.curves, coefficients=coefficients)
    steep = replace(model, accel=replace(model.accel, curves=curves))
    functions = compensate_imu(steep, "matrix", device.range_degc, (10.5, 8.8), (1e-6, 1e-8))
    errors = imuc._model_errors(steep, functions, device, ran.c.build)
    with pytest.raises(RefusedError) as refusal:
        imuc._refuse_model_errors(str(unit.path), errors)
    assert str(refusal.value) == (
        f"{unit.path}, [device] range_degc: N(T) of the accelerometer is {errors[0] * 1e6:.4g} "
        "micro-g off the fitted model; expected at most 1 micro-g; narrow the range, or check the "
        "temperature coefficients"
    )
    imuc._refuse_model_errors(unit, (1e-6, 0.01))


def test_without_a_device_no_c_is_written_and_it_is_said(ran: Ran) -> None:
    made = replace(ran.made, c=None)
    files = dynamic_files(made)
    assert set(files) == {"calibration.json", "dynamic.html"}
    assert b"No C: unit.toml has no [device]" in files["dynamic.html"]
    assert (
        "C               none: unit.toml has no [device]; add it with accel_bits, "
        "accel_full_scale_g, gyro_bits, gyro_full_scale_deg_per_s, degc_per_code, range_degc\n"
    ) in dynamic_summary(made, files, "build/IMU-SIM")


def test_a_simulated_unit_without_its_recording_says_how_to_make_it(tmp_path: Path) -> None:
    unit = copied(tmp_path / "IMU-SIM")
    done = CliRunner().invoke(main, ["calib", str(unit), "--build", str(tmp_path / "build")])
    assert str(done.exception) == (
        f"{unit / 'recording.csv'}: no such file; expected the recording that unit.toml names; "
        f"make simulate UNIT=IMU-SIM, or triaxcal simulate {unit}, writes it"
    )
    assert not done.output  # no bar of work that has not begun
    (unit / "imu_truth.toml").unlink()
    done = CliRunner().invoke(main, ["calib", str(unit), "--build", str(tmp_path / "build")])
    assert str(done.exception).endswith("names; put it there, or correct [dynamic] recording")
    assert not (tmp_path / "build").exists()
