"""The C of an IMU before the tools: both triads and what calls them, and planted mistakes."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from builds import PROVENANCE
from test_imu import imu_of, triads
from triaxcal.cli.main import main
from triaxcal.codegen.imu import ImuBuild, build_imu
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.unit.angles import PITCH_ROLL, AnglesChoice
from triaxcal.verify import angles, cost, cppcheck, gappa, imu, wp_imu
from triaxcal.verify.campaign import CHECKS
from triaxcal.verify.image_reader import image_length
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import UNITS, needs
from verify.test_cost import counted

TOOLS = ("gappa", "frama-c", "cppcheck", "clang", "arm-none-eabi-gcc", "qemu-system-arm")
GROUPS = {
    imu.ACCELEROMETER: [key for key, _, _ in CHECKS],
    imu.GYRO: [key for key, _, _ in CHECKS],
    imu.BOTH: [key for key, _, _ in imu.CHECKS],
}


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """IMU-SIM with a short recording and few temperature codes."""
    folder = tmp_path_factory.mktemp("imu") / "IMU-SHORT"
    shutil.copytree(UNITS / "IMU-SIM", folder, ignore=shutil.ignore_patterns("recording.csv"))
    for name, old, new in (
        ("imu_truth.toml", "minutes_per_axis = 4", "minutes_per_axis = 1.5"),
        ("unit.toml", "0.0078125", "0.125"),
    ):
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")
    write_simulated_unit(folder)
    return folder


def run(command: str, unit: Path) -> Result:
    arguments = [command, str(unit), "--build", str(unit.parent / "build")]
    return CliRunner().invoke(main, arguments)


@pytest.fixture(scope="module")
def verified(unit: Path) -> tuple[Result, Path]:
    """`triaxcal verify` after `triaxcal calib`: what it printed, and the folder of results."""
    assert run("calib", unit).exit_code == 0
    return run("verify", unit), unit.parent / "build" / unit.name


@needs(*TOOLS)
@pytest.mark.slow
def test_every_check_passes(verified: tuple[Result, Path]) -> None:
    done, _ = verified
    assert done.exit_code == 0, done.output
    count = sum(map(len, GROUPS.values()))
    assert f"\n{count + 4} passed, 0 failed, 0 not done\n" in done.output
    lines = done.output.split("\nresults in ")[0].splitlines()
    assert {"accelerometer", "gyro", "both triads"} <= set(lines)
    assert lines.count("Eva: any image            passed    0 alarms") == 3
    assert max(map(len, lines)) <= 80


@needs(*TOOLS)
@pytest.mark.slow
def test_results_are_in_verification_json_and_on_the_page(verified: tuple[Result, Path]) -> None:
    _, folder = verified
    tools = json.loads((folder / "verification.json").read_text(encoding="utf-8"))["tools"]
    assert {group: list(entries) for group, entries in tools.items()} == GROUPS
    page = (folder / "dynamic.html").read_text(encoding="utf-8")
    assert "<b>both triads: eva_image</b></td><td>passed: 0 alarms</td>" in page
    assert "not run on this delivery" not in page
    # Costs are of the routine that is named: they were the accelerometer's for both.
    costs = [tools[group]["cost"]["cores"]["RV32IM"] for group in (imu.ACCELEROMETER, imu.GYRO)]
    assert costs[1]["apply"][0] > costs[0]["apply"][1]


def test_a_unit_without_c_is_refused(unit: Path, tmp_path: Path) -> None:
    other = shutil.copytree(unit, tmp_path / unit.name)
    text = (other / "unit.toml").read_text(encoding="utf-8")
    (other / "unit.toml").write_text(text[: text.index("[device]")], encoding="utf-8")
    done = CliRunner().invoke(main, ["verify", str(other), "--build", str(tmp_path / "build")])
    assert str(done.exception) == (
        f"{other / 'unit.toml'}: has no [device], so no C is generated; expected [device] "
        "with accel_bits, accel_full_scale_g, gyro_bits, gyro_full_scale_deg_per_s, "
        "degc_per_code, range_degc; add it: docs/how-to/imu.md"
    )
    assert not (tmp_path / "build").exists()


@pytest.fixture(scope="module")
def build() -> ImuBuild:
    """An IMU whose constants depend on the temperature."""
    return build_imu(imu_of(), triads(), (PROVENANCE, PROVENANCE), 1000)


@needs(*TOOLS)
@pytest.mark.slow
def test_every_check_passes_over_temperature(build: ImuBuild, tmp_path: Path) -> None:
    for outcomes in imu.verify_imu(tmp_path, build).values():
        for outcome in outcomes:
            assert outcome.result == PASSED, outcome


CHECK = {key: check for key, _, check in imu.CHECKS}


@needs("frama-c")
def test_contracts_in_the_delivered_files_do_not_stop_eva(tmp_path: Path) -> None:
    """Their words are defined in a file that Eva does not read."""
    accel, gyro = triads()
    full = replace(accel.adc, bits=32, code_min=-(2**31), code_max=2**31 - 1)
    made = build_imu(imu_of(), (replace(accel, adc=full), gyro), (PROVENANCE, PROVENANCE), 100)
    assert b"/*@ requires" in made.files["triax_comp.c"]
    outcome = CHECK["eva_image"](imu.Both.create(tmp_path, made))
    assert outcome.result == PASSED, outcome


def broken(build: ImuBuild, folder: Path, old: str, new: str) -> imu.Both:
    """Files of an IMU with a text of triax_imu.c replaced."""
    text = build.files["triax_imu.c"].decode()
    assert old in text
    files = {**build.files, "triax_imu.c": text.replace(old, new).encode()}
    return imu.Both.create(folder, replace(build, files=files))


@needs("frama-c", "cppcheck", "clang")
@pytest.mark.parametrize(
    ("key", "change", "says"),
    [
        ("eva_image", ("&image[accel_size]", "&image[accel_size + 5u]"), "mem_access"),
        ("eva_codes", ("raw_gyro, accel, rate", "raw_gyro, &accel[1], rate"), "mem_access"),
        ("gcc_sanitizers", ("raw_gyro, accel, rate", "raw_gyro, raw_accel, rate"),
         "answers differ"),
        ("clang_sanitizers", ("accel_status | (", "gyro_status | ("), "answers differ"),
        ("cppcheck", ("status = triax_gyro_calib_check", "triax_gyro_calib_check"), "MISRA 17.7"),
    ],
)  # fmt: skip
def test_a_planted_mistake_in_what_joins_the_triads_is_found(
    build: ImuBuild, tmp_path: Path, key: str, change: tuple[str, str], says: str
) -> None:
    outcome = CHECK[key](broken(build, tmp_path, *change))
    assert outcome.result == FAILED
    assert any(says in detail for detail in outcome.details), outcome.details


@needs("frama-c", "why3", "cvc4", "z3")
@pytest.mark.slow
def test_what_joins_the_triads_is_proven(build: ImuBuild, tmp_path: Path) -> None:
    outcome = CHECK["wp"](imu.Both.create(tmp_path, build))
    assert outcome.result == PASSED, outcome
    assert set(outcome.figures["goals"]) == {"lemmas", "set_temperature", "apply", "calib_load"}


@needs("frama-c", "why3", "cvc4", "z3")
def test_of_another_file_nothing_is_proven(build: ImuBuild, tmp_path: Path) -> None:
    outcome = CHECK["wp"](broken(build, tmp_path, "accel_status | (", "gyro_status | ("))
    assert outcome.result == FAILED
    said = "triax_imu.c is not the one for these shapes: nothing is proven of it"
    assert outcome.finding == said


def test_a_pair_without_contracts_is_not_proven(build: ImuBuild, tmp_path: Path) -> None:
    shape = replace(build.accel.shape, quadratic=True, rate=True)
    other = replace(build, accel=replace(build.accel, shape=shape))
    outcome = wp_imu.check(tmp_path, other)
    assert outcome.result == NOT_DONE
    assert outcome.finding == ("not done for quadratic terms with a term in dT/dt (accelerometer)")


@pytest.fixture(scope="module")
def apart() -> ImuBuild:
    """An IMU whose gyro has a thermometer of its own."""
    both = (PROVENANCE, PROVENANCE)
    return build_imu(imu_of(), triads(), both, 1000, two_thermometers=True)


@needs("frama-c", "cppcheck", "clang")
@pytest.mark.parametrize("key", ["eva_codes", "cppcheck", "gcc_sanitizers"])
def test_what_joins_the_triads_passes_with_two_thermometers(
    apart: ImuBuild, tmp_path: Path, key: str
) -> None:
    outcome = CHECK[key](imu.Both.create(tmp_path, apart))
    assert outcome.result == PASSED, outcome


@needs("clang")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("gyro_calib, gyro_temp_code);", "gyro_calib, accel_temp_code + (0 * gyro_temp_code));"),
        ("accel_calib, accel_temp_code);", "accel_calib, gyro_temp_code + (0 * accel_temp_code));"),
    ],
)
def test_the_code_of_the_other_thermometer_is_found(
    apart: ImuBuild, tmp_path: Path, old: str, new: str
) -> None:
    outcome = CHECK["clang_sanitizers"](broken(apart, tmp_path, old, new))
    assert outcome.result == FAILED


def test_of_a_gyro_a_cost_that_varies_is_told_and_fails_where_it_is_promised(
    build: ImuBuild, tmp_path: Path
) -> None:
    """On a Cortex-M0 (core 0) a gyro has no assembly."""
    work = Workspace.create(tmp_path, {}, build.gyro, build.gyro_bound)
    told = cost.outcome_of([counted(work, 0, 31), counted(work, 1, 30)])
    assert (told.result, told.finding) == (
        PASSED,
        "set_temperature + apply: M0 100 + 30 to 31, M3 100 + 30; apply depends on its input on M0",
    )
    assert cost.outcome_of([counted(work, 0, 30), counted(work, 1, 31)]).result == FAILED


@needs("gappa")
def test_constant_functions_are_bounded_exactly(tmp_path: Path) -> None:
    """Gappa finds names for one expression, and the exact bound itself: neither is a fault."""
    flat = build_imu(imu_of(flat=True), triads(), (PROVENANCE, PROVENANCE), 1000)
    image = flat.files["triax_imu.bin"]
    files = {"triax_calib.bin": image[: image_length(image)]}
    outcome = gappa.check(Workspace.create(tmp_path, files, flat.accel, flat.accel_bound))
    assert outcome.result == PASSED, outcome
    assert outcome.figures["ratio_to_exact"] == pytest.approx(1.0, abs=1e-12)


ANGLE_CHECKS = {key: check for key, _, check in angles.CHECKS}


@pytest.fixture(scope="module")
def with_angles() -> ImuBuild:
    """An IMU whose device makes pitch and roll."""
    return build_imu(
        imu_of(), triads(), (PROVENANCE, PROVENANCE), 1000, choice=AnglesChoice(PITCH_ROLL)
    )


@needs("gcc", "clang")
@pytest.mark.parametrize("key", ["angles_gcc_analyzer", "angles_gcc_sanitizers"])
def test_the_angles_are_checked_with_the_accelerometer(
    with_angles: ImuBuild, tmp_path: Path, key: str
) -> None:
    works = imu.triads(tmp_path, with_angles)
    assert works[imu.GYRO].angles is None
    outcome = ANGLE_CHECKS[key](works[imu.ACCELEROMETER])
    assert outcome.result == PASSED, outcome


@needs("frama-c", "cppcheck", "clang", "arm-none-eabi-gcc", "qemu-system-arm")
@pytest.mark.slow
def test_every_check_of_the_angles_of_an_imu_passes(with_angles: ImuBuild, tmp_path: Path) -> None:
    work = imu.triads(tmp_path, with_angles)[imu.ACCELEROMETER]
    for check in (cppcheck.check, *ANGLE_CHECKS.values()):
        outcome = check(work)
        assert outcome.result == PASSED, outcome


@needs("gcc")
def test_a_planted_mistake_in_the_angles_of_an_imu_is_found(
    with_angles: ImuBuild, tmp_path: Path
) -> None:
    name = "triax_angles.c"
    text = with_angles.files[name].replace(b"83443u", b"83442u")
    assert text != with_angles.files[name]
    wrong = replace(with_angles, files={**with_angles.files, name: text})
    work = imu.triads(tmp_path, wrong)[imu.ACCELEROMETER]
    assert ANGLE_CHECKS["angles_gcc_sanitizers"](work).result == FAILED
