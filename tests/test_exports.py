"""`triaxcal export`: layouts for build systems, parameters for autopilots."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.fitted import Fitted
from triaxcal.exports.registry import TARGETS
from triaxcal.exports.target import Source
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.unit.adc import whole_adc

ROOT = Path(__file__).parents[1]
G = 9.80665
AXES = "XYZ"
LAYOUTS = ("cmake", "make", "zephyr", "platformio", "arduino", "esp-idf", "rust")


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return triaxcal.deliver(ROOT / "units" / "AT-SIM", tmp_path_factory.mktemp("build")).folder


@pytest.fixture(scope="module")
def fitted(delivered: Path) -> Fitted:
    return triaxcal.load(delivered / "calibration.json").fitted


# ---- autopilots: their own formulas, from their sources, on the file as it is ----


def ardupilot(p: dict[str, float], reading: np.ndarray, temp: np.ndarray) -> np.ndarray:
    """AP_InertialSensor_tempcal.cpp, correct_sensor; then offset and scale. m/s^2."""
    low, high = p["INS_TCAL1_TMIN"], p["INS_TCAL1_TMAX"]
    c = np.array([[p[f"INS_TCAL1_ACC{n}_{a}"] for a in AXES] for n in (1, 2, 3)])

    def evaluate(t: np.ndarray) -> np.ndarray:
        t = t[:, None]
        return (c[0] + (c[1] + c[2] * t) * t) * t * 1e-6

    assert p["INS_TCAL1_ENABLE"] == 1
    v = reading - evaluate(np.clip(temp, low, high) - 35.0)
    cal_temp = np.clip(np.full(len(temp), p["INS_ACC1_CALTEMP"]), low, high)
    v = v + evaluate(cal_temp - 35.0)
    offset, scale = (np.array([p[f"INS_ACC{w}_{a}"] for a in AXES]) for w in ("OFFS", "SCAL"))
    return (v - offset) * scale


def px4(p: dict[str, float], reading: np.ndarray, temp: np.ndarray) -> np.ndarray:
    """TemperatureCompensation.cpp, calc_thermal_offsets_3D; Accelerometer.hpp, Correct. m/s^2."""
    t = (np.clip(temp, p["TC_A0_TMIN"], p["TC_A0_TMAX"]) - p["TC_A0_TREF"])[:, None]
    x0, x1, x2, x3 = (np.array([p[f"TC_A0_X{n}_{i}"] for i in range(3)]) for n in range(4))
    assert p["TC_A_ENABLE"] == 1
    thermal = x0 + x1 * t + x2 * t**2 + x3 * t**3
    offset, scale = (np.array([p[f"CAL_ACC0_{a}{w}"] for a in AXES]) for w in ("OFF", "SCALE"))
    return (reading - thermal - offset) * scale


def parsed(text: str) -> tuple[dict[str, float], np.ndarray, list[float]]:
    """Parameters, the driver's factors, and the last row of the table of costs, in mg."""
    lines = text.splitlines()
    rows = [re.split(r"[,\t]", line) for line in lines if line[0] != "#"]
    values = {r[0]: float(r[1]) if len(r) == 2 else 0.0 for r in rows if len(r) == 2}
    values |= {r[2]: float(r[3]) for r in rows if len(r) == 5}
    (driver,) = [line for line in lines if "The driver gives" in line]
    factors = np.array([float(c) for c in re.findall(r"-?\d+\.\d+", driver)])
    (last,) = [line for line in lines if "all of this" in line]
    return values, factors, [float(v) for v in last.split()[-3:]]


FORMULAS = {"ardupilot": ("ardupilot.param", ardupilot), "px4": ("px4.params", px4)}


@pytest.mark.parametrize("name", FORMULAS)
def test_the_formula_of_the_autopilot_gives_the_stated_residual(
    name: str, delivered: Path, fitted: Fitted, tmp_path: Path
) -> None:
    file, formula = FORMULAS[name]
    made = triaxcal.export(delivered, name, tmp_path)
    assert made.files == (file,)
    text = (tmp_path / file).read_text()
    values, factors, stated = parsed(text)
    dwells = [d for d in fitted.measurements.dwells if d.position in CHECK_POSITIONS]
    assert f"at {len(dwells)} check dwells, which were not fitted" in text
    readings = np.array([d.voltage_v for d in dwells])
    temps = np.array([d.temp_degc for d in dwells])
    found = formula(values, readings * factors, temps) / G
    error = np.abs(np.linalg.norm(found, axis=1) - fitted.unit.gravity_g)
    model = triaxcal.load(delivered / "calibration.json").apply(readings, temps)
    # The table has four digits, the driver's factors six of 1 g.
    limit = {"rel": 5e-4, "abs": 2e-3}
    assert error.max() * 1e3 == pytest.approx(stated[0], **limit)
    assert np.sqrt((error**2).mean()) * 1e3 == pytest.approx(stated[1], **limit)
    assert np.abs(found - model).max() * 1e3 == pytest.approx(stated[2], **limit)


@pytest.mark.parametrize("name", FORMULAS)
def test_no_other_scale_or_offset_is_better_over_range_and_directions(
    name: str, delivered: Path, tmp_path: Path
) -> None:
    file, formula = FORMULAS[name]
    triaxcal.export(delivered, name, tmp_path)
    values, factors, _ = parsed((tmp_path / file).read_text())
    calibration = triaxcal.load(delivered / "calibration.json")
    temps = np.repeat(np.linspace(*calibration.range_degc, 101), 6)
    force = np.tile(np.vstack([np.eye(3), -np.eye(3)]), (101, 1))  # <f f^T> = 1/3
    K, U0 = calibration.constants(temps)
    found = formula(values, (np.einsum("nij,nj->ni", K, force) + U0) * factors, temps) / G
    before = np.mean((found - force) ** 2)
    for i in range(3):
        for factor, shift in ((1.0005, 0.0), (0.9995, 0.0), (1.0, 1e-4), (1.0, -1e-4)):
            moved = found.copy()
            moved[:, i] = moved[:, i] * factor + shift
            assert np.mean((moved - force) ** 2) > before


def test_costs_are_of_what_is_left_out(delivered: Path, fitted: Fitted, tmp_path: Path) -> None:
    """A unit without cross terms and with K constant loses nothing."""
    text = triaxcal.export(delivered, "px4", tmp_path).summary
    rows = {line[:31].strip(): line.split()[-1] for line in text.splitlines()}
    assert float(rows["without cross terms"]) > 10.0
    assert float(rows["K constant over temperature"]) > 1.0
    thermal = fitted.calibration.thermal
    curves = thermal.curves
    coefficients = curves.coefficients.copy()
    coefficients[:, :9, 1:] = 0.0
    coefficients[:, [1, 2, 3, 5, 6, 7], 0] = 0.0
    plain = replace(thermal, curves=replace(curves, coefficients=coefficients))
    without = replace(fitted, calibration=replace(fitted.calibration, thermal=plain))
    found = TARGETS["px4"].make(Source(delivered, without)).summary
    (last,) = [line for line in found.splitlines() if "all of this" in line]
    assert float(last.split()[-1]) < 1e-3  # float32 parameters: 1e-7 of 1 g


def test_betaflight_trims_whole_codes(delivered: Path, fitted: Fitted) -> None:
    with pytest.raises(RefusedError, match="raw codes of 24 bits; expected at most 16: Betaflight"):
        TARGETS["betaflight"].make(Source(delivered, fitted))
    narrow = replace(fitted, unit=replace(fitted.unit, adc=whole_adc(16, 2.5)))
    made = TARGETS["betaflight"].make(Source(delivered, narrow))
    text = made.files["betaflight.txt"].decode()
    (trims,) = re.findall(r"^set acc_calibration = (.*),1$", text, re.MULTILINE)
    trim = np.array([int(v) for v in trims.split(",")])
    _, U0 = triaxcal.load(delivered / "calibration.json").constants(fitted.unit.t0_degc)
    # All three sensitivities are negative: the driver turns the codes.
    assert np.abs(trim + U0 * 2**15 / 2.5).max() <= 0.5
    assert "Codes of -x -y -z; acc_1G of the driver must be 7199" in text


# ---- build systems ----


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_has_the_c_that_was_checked(name: str, delivered: Path, tmp_path: Path) -> None:
    made = triaxcal.export(delivered, name, tmp_path)
    hashed = json.loads((delivered / "verification.json").read_text())["files_sha256"]
    found = {Path(f).name: tmp_path / f for f in made.files}
    for file in hashed:
        assert found[file].read_bytes() == (delivered / file).read_bytes()
    added = [tmp_path / f for f in made.files if Path(f).name not in hashed]
    assert added
    for path in added:
        text = path.read_text()
        assert "{{" not in text
        if path.suffix == ".json":
            assert json.loads(text)["name"] == "triax"
        if path.suffix == ".toml":
            assert tomllib.loads(text)["package"]["name"] == "triax"


def test_metadata_names_files_that_are_there(delivered: Path, tmp_path: Path) -> None:
    for name in LAYOUTS:
        folder = tmp_path / name
        made = triaxcal.export(delivered, name, folder)
        text = "\n".join(
            (folder / f).read_text() for f in made.files if not f.endswith((".bin", ".c"))
        )
        for path in re.findall(r"(?<![\w/])(?:src|c)/triax_\w+\.[ch]\b", text):
            assert (folder / path).is_file(), path
    properties = (tmp_path / "arduino" / "library.properties").read_text()
    assert {line.split("=")[0] for line in properties.splitlines()} >= {
        "name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url",
        "architectures",
    }  # fmt: skip
    rust = (tmp_path / "rust" / "src" / "lib.rs").read_text()
    assert re.search(r"pub use triax_[0-9a-f]{8}_apply as triax_apply;", rust)


def test_cmake_package_is_found_after_it_is_installed(delivered: Path, tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("cmake not found: sudo apt-get install cmake")
    triaxcal.export(delivered, "cmake", tmp_path / "source")
    user = tmp_path / "user"
    user.mkdir()
    (user / "main.c").write_text(
        '#include "triax_calib.h"\nint main(void) { triax_state_t state;'
        " return (int)triax_set_temperature(&state, &TRIAX_CALIB, 0); }\n"
    )
    (user / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(user C)\nfind_package(triax REQUIRED)\n"
        "add_executable(user main.c)\ntarget_link_libraries(user PRIVATE triaxcal::triax)\n"
    )
    prefix = tmp_path / "installed"
    for command in (
        ["cmake", "-S", "source", "-B", "made", f"-DCMAKE_INSTALL_PREFIX={prefix}"],
        ["cmake", "--build", "made", "--target", "install"],
        ["cmake", "-S", "user", "-B", "used", f"-DCMAKE_PREFIX_PATH={prefix}"],
        ["cmake", "--build", "used"],
        ["used/user"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_cmake_example_runs_on_a_cortex_m3(delivered: Path, tmp_path: Path) -> None:
    for tool in ("cmake", "arm-none-eabi-gcc", "qemu-system-arm"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} not found")
    triaxcal.export(delivered, "cmake", tmp_path / "triax")
    example = ROOT / "examples" / "cmake"
    for command in (
        ["cmake", "-S", str(example), "-B", "made", f"-DEXPORTED={tmp_path / 'triax'}",
         f"-DCMAKE_TOOLCHAIN_FILE={example / 'cortex-m3.cmake'}"],
        ["cmake", "--build", "made"],
        ["python3", str(ROOT / "examples" / "cortex-m3" / "check.py"), str(delivered),
         "qemu-system-arm", "made/firmware.elf"],
    ):  # fmt: skip
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "check: 8 lines as expected" in done.stdout


# ---- the command, and what is refused ----


def test_command_line(delivered: Path, tmp_path: Path) -> None:
    ran = CliRunner().invoke(
        main, ["export", str(delivered), "--to", "make", "--into", str(tmp_path)]
    )
    assert ran.exit_code == 0, ran.output
    assert "7 delivered files and triax.mk" in ran.output
    listed = CliRunner().invoke(main, ["export", "--help"]).output
    assert all(target.name in listed for target in TARGETS)


def test_what_is_refused(delivered: Path, tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=r"export target: found 'px' .*did you mean \"px4\""):
        triaxcal.export(delivered, "px", tmp_path)
    with pytest.raises(RefusedError, match="a file; expected a folder"):
        triaxcal.export(delivered, "make", ROOT / "README.md")
    changed = tmp_path / "changed"
    shutil.copytree(delivered, changed)
    (changed / "triax_calib.c").write_text("int x;\n")
    with pytest.raises(RefusedError, match=r"triax_calib\.c: is missing or is not the file"):
        triaxcal.export(changed, "make", tmp_path / "out")
    (changed / "verification.json").unlink()
    with pytest.raises(
        RefusedError, match=r"verification\.json: missing, or does not name the files"
    ):
        triaxcal.export(changed, "make", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_make_fragment_builds_the_c(delivered: Path, tmp_path: Path) -> None:
    triaxcal.export(delivered, "make", tmp_path / "triax")
    (tmp_path / "main.c").write_text(
        '#include "triax_calib.h"\nint main(void) { triax_state_t state;'
        " return (int)triax_set_temperature(&state, &TRIAX_CALIB, 0); }\n"
    )
    (tmp_path / "Makefile").write_text(
        "include triax/triax.mk\nprogram: main.c $(TRIAX_SOURCES)\n\tgcc $(TRIAX_CFLAGS) $^ -o $@\n"
    )
    for command in (["make"], ["./program"]):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


AVR_MAIN = """#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/interrupt.h>
#include "triax_calib.h"
static void print(char c) { while (!(UCSR0A & (1 << UDRE0))) { } UDR0 = (uint8_t)c; }
int main(void) {
    static triax_state_t state;
    static const int32_t RAW[3] = {1845000, -12000, 9000};
    int32_t accel[3];
    uint32_t status;
    uint8_t i, k;
    UCSR0B = 1 << TXEN0;
    status = triax_set_temperature(&state, &TRIAX_CALIB, 2560);
    status |= triax_apply(&state, RAW, accel);
    for (i = 0; i < 4; i++) {
        const uint32_t word = (i < 3) ? (uint32_t)accel[i] : status;
        for (k = 0; k < 8; k++) { print("0123456789abcdef"[(word >> (28 - 4 * k)) & 15]); }
        print(' ');
    }
    print(10);
    for (k = 0; k < 255; k++) { while (!(UCSR0A & (1 << UDRE0))) { } }
    cli();
    sleep_mode();
    return 0;
}
"""


def test_arduino_library_runs_on_an_avr(delivered: Path, tmp_path: Path) -> None:
    for tool in ("avr-gcc", "simavr"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} not found: sudo apt-get install gcc-avr avr-libc simavr")
    library = tmp_path / "triax"
    triaxcal.export(delivered, "arduino", library)
    (tmp_path / "main.c").write_text(AVR_MAIN)
    sources = [str(p) for p in sorted((library / "src").glob("*.c"))]
    build = ["avr-gcc", "-mmcu=atmega1284p", "-DF_CPU=16000000UL", "-Os", f"-I{library / 'src'}"]
    subprocess.run([*build, "main.c", *sources, "-o", "a.elf"], cwd=tmp_path, check=True)
    command = ["simavr", "-m", "atmega1284p", "-f", "16000000", "a.elf"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    plain = re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)  # simavr colours it
    words = re.findall(r"\b[0-9a-f]{8}\b", plain)
    firmware = triaxcal.firmware(triaxcal.load(delivered / "calibration.json"))
    accel, status = firmware.apply([[1845000, -12000, 9000]], [2560])
    expected = [*accel[0].astype(np.uint32), status[0]]
    assert words == [f"{int(w):08x}" for w in expected], done.stdout + done.stderr


def test_a_prefix_is_in_every_name_and_the_c_is_that_of_firmware(
    delivered: Path, tmp_path: Path
) -> None:
    build = tmp_path / "build"
    shutil.copytree(delivered, build / "AT-SIM")
    command = ["export", str(build / "AT-SIM"), "--build", str(build), "--to", "make"]
    ran = CliRunner().invoke(main, [*command, "--prefix", "left_accel"])
    assert ran.exit_code == 0, ran.output
    assert "7 delivered files and left_accel.mk" in ran.output
    layout = build / "AT-SIM-left_accel-make"
    made = triaxcal.delivered_firmware(build / "AT-SIM", prefix="left_accel").write(tmp_path / "c")
    assert len(made) == 7
    for path in made:
        (exported,) = layout.rglob(path.name)
        assert exported.read_bytes() == path.read_bytes()
    # A layout, and what `firmware --prefix` writes, are no units; the unit and its prefix are told.
    for folder in (tmp_path / "c", layout):
        with pytest.raises(RefusedError) as refusal:
            triaxcal.export(folder, "make")
        assert str(refusal.value) == (
            f"{folder}: no unit.toml in it, but left_accel_calib.h: files that were made of a "
            "unit; expected that unit, or its delivered folder; name it; where the command has "
            "--prefix, this folder has the C of --prefix left_accel"
        )
    with pytest.raises(RefusedError, match="expected none: ArduPilot gets parameters, no C"):
        triaxcal.export(delivered, "ardupilot", tmp_path / "p", prefix="left_accel")
