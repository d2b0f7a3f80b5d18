"""What production gets of an IMU: layouts, A2L, parameters of autopilots, another prefix."""

from __future__ import annotations

import json
import re
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.base.jsontext import sha256_of_files
from triaxcal.cli.main import main
from triaxcal.simulation.unit import write_simulated_unit

SIM = Path(__file__).parents[1] / "units" / "IMU-SIM"
G = 9.80665
LOCAL_G = 9.81
RANGE_DEGC = (-20.0, 60.0)
DEG_PER_H = np.pi / 180 / 3600
BLOCKS = ["accelerometer-thermal", "gyro-thermal", "g-drift"]
# Of a consumer's part, in SI units; slopes a degree of bias and scale factor.
BIAS = np.array([0.12, -0.2, 0.07])
GAMMA = np.array([[2e-3, 0, 0], [5e-3, -1e-3, 0], [-4e-3, 3e-3, 4e-3]])
BIAS_SLOPE, SCALE_SLOPE = np.array([1e-3, -2e-3, 5e-4]), np.array([3e-5, -2e-5, 1e-5])
DRIFT = np.array([0.01, -0.02, 0.005])
THETA = np.array([[3e-3, 1e-3, -2e-3], [4e-3, -2e-3, 1e-3], [-1e-3, 2e-3, 1e-3]])
DRIFT_SLOPE, RATE_SLOPE = np.array([1e-4, -5e-5, 2e-5]), np.array([2e-5, 1e-5, -1e-5])
BY_FORCE = DEG_PER_H * np.array([[90.0, -60.0, 20.0], [30.0, 10.0, -50.0], [5.0, 70.0, -40.0]])
VALUES = {
    "accelerometer-bias": BIAS,
    "accelerometer-matrix": GAMMA[np.tril_indices(3)],
    "accelerometer-thermal": np.concatenate([BIAS_SLOPE, SCALE_SLOPE]),
    "gyro-bias": DRIFT,
    "gyro-matrix": THETA.ravel(),
    "gyro-thermal": np.concatenate([DRIFT_SLOPE, RATE_SLOPE]),
    "g-drift": BY_FORCE.ravel(),
}


def document() -> dict[str, Any]:
    """A calibration.json, with the C of a device of 16 bits and a coarse thermometer."""
    from triaxcal.dynamic.blocks.base import BASE
    from triaxcal.dynamic.blocks.registry import EXTENSIONS
    from triaxcal.dynamic.layout import Layout

    layout = Layout((*BASE, *(b for name in BLOCKS for b in EXTENSIONS[name].blocks)))
    p = np.concatenate([VALUES[block.name] for block in layout.blocks])
    rows = [
        {"name": s.name, "unit": s.unit, "si_per_unit": s.per_unit, "value": float(v), "sd": 1e-6}
        for s, v in zip(layout.states, p, strict=True)
    ]
    device = {
        "temperature_sensor": {"degc_per_code": 0.25, "degc_at_zero": 0.0},
        "accel_bits": 16, "accel_full_scale_g": 16.0, "gyro_bits": 16,
        "gyro_full_scale_deg_per_s": 2000.0, "range_degc": list(RANGE_DEGC), "accel_q": 24,
        "gyro_rate_q": 19, "prefix": "imu_left",
    }  # fmt: skip
    return {
        "format": 1, "kind": "dynamic", "unit": "I-1", "serial": "S-1", "inputs_sha256": "5a" * 32,
        "reference_degc": 20.0, "range_degc": list(RANGE_DEGC), "local_gravity_m_per_s2": LOCAL_G,
        "blocks": BLOCKS, "states": rows, "covariance": np.eye(len(rows)).tolist(),
        "firmware": {"device": device, "header": ["made by hand"], "date": "2026-03-30",
                     "axes": ["-acc2, acc1, acc3", "gx, gy, gz"]},
    }  # fmt: skip


def read(force: np.ndarray, rate: np.ndarray, temp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the sensors give, m/s^2 and rad/s: P2 (1), (2), (13), (23), (24), written out."""
    t = (temp - 20.0)[:, None]
    accel = force + force @ GAMMA.T + force * SCALE_SLOPE * t + BIAS + BIAS_SLOPE * t
    gyro = rate + rate @ THETA.T + rate * RATE_SLOPE * t + DRIFT + DRIFT_SLOPE * t
    return accel, gyro + force / LOCAL_G @ BY_FORCE.T


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> triaxcal.ImuFirmware:
    path = tmp_path_factory.mktemp("build") / "calibration.json"
    path.write_text(json.dumps(document()))
    return triaxcal.firmware_imu(triaxcal.load_imu(path))


@pytest.fixture(scope="module")
def delivered(made: triaxcal.ImuFirmware, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A delivered folder, without the page."""
    folder = tmp_path_factory.mktemp("build") / "I-1"
    folder.mkdir()
    (folder / "calibration.json").write_text(json.dumps(document()))
    assert made.check() > 1e6
    for name, content in made.files.items():
        (folder / name).write_bytes(content)
    hashes = json.dumps({"files_sha256": sha256_of_files(made.files)})
    (folder / "verification.json").write_text(hashes)
    return folder


# ---- autopilots: their own formulas, from their sources, on the file as it is ----


def values_of(path: Path) -> dict[str, float]:
    lines = [line for line in path.read_text().splitlines() if line[0] != "#"]
    rows = [re.split(r"[,\t]", line) for line in lines]
    return {r[0] if len(r) == 2 else r[2]: float(r[1] if len(r) == 2 else r[3]) for r in rows}


def ardupilot(p: dict[str, float], reading: np.ndarray, temp: np.ndarray, what: str) -> np.ndarray:
    """AP_InertialSensor_tempcal.cpp, correct_sensor; AP_InertialSensor_Backend.cpp."""
    c = np.array([[p[f"INS_TCAL1_{what}{n}_{a}"] for a in "XYZ"] for n in (1, 2, 3)])

    def evaluate(at: np.ndarray) -> np.ndarray:
        t = np.clip(at, p["INS_TCAL1_TMIN"], p["INS_TCAL1_TMAX"])[:, None] - 35.0
        return (c[0] + (c[1] + c[2] * t) * t) * t * 1e-6

    cal_temp = np.full(len(temp), p[f"INS_{what}1_CALTEMP"])
    v = reading - evaluate(temp) + evaluate(cal_temp)
    offset = {"ACC": "INS_ACCOFFS", "GYR": "INS_GYROFFS"}[what]
    v = v - np.array([p[f"{offset}_{a}"] for a in "XYZ"])
    return v * np.array([p[f"INS_ACCSCAL_{a}"] for a in "XYZ"]) if what == "ACC" else v


def px4(p: dict[str, float], reading: np.ndarray, temp: np.ndarray, what: str) -> np.ndarray:
    """TemperatureCompensation.cpp; Accelerometer.hpp and Gyroscope.hpp, Correct."""
    sensor, curve = {"ACC": ("CAL_ACC0", "TC_A0"), "GYR": ("CAL_GYRO0", "TC_G0")}[what]
    t = (np.clip(temp, p[f"{curve}_TMIN"], p[f"{curve}_TMAX"]) - p[f"{curve}_TREF"])[:, None]
    x = [np.array([p[f"{curve}_X{n}_{i}"] for i in range(3)]) for n in range(4)]
    v = reading - (x[0] + x[1] * t + x[2] * t**2 + x[3] * t**3)
    v = v - np.array([p[f"{sensor}_{a}OFF"] for a in "XYZ"])
    return v * np.array([p[f"{sensor}_{a}SCALE"] for a in "XYZ"]) if what == "ACC" else v


FORMULAS = {"ardupilot": ("ardupilot.param", ardupilot), "px4": ("px4.params", px4)}


@pytest.mark.parametrize("name", FORMULAS)
def test_the_autopilot_is_off_by_what_the_file_states(
    name: str, delivered: Path, tmp_path: Path
) -> None:
    file, formula = FORMULAS[name]
    summary = triaxcal.export(delivered, name, tmp_path).summary
    p = values_of(tmp_path / file)
    rng = np.random.default_rng(7)
    temp = rng.uniform(*RANGE_DEGC, 4000)
    unit = rng.normal(size=(4000, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    accel, at_rest = read(unit * G, np.zeros_like(unit), temp)
    rate = np.deg2rad(100.0) * unit
    _, turning = read(np.zeros_like(unit), rate, temp)
    off = np.abs(formula(p, accel, temp, "ACC") / G - unit).max() * 1e3
    rest = np.rad2deg(np.abs(formula(p, at_rest, temp, "GYR")).max()) * 3600
    turned = np.rad2deg(np.abs(formula(p, turning, temp, "GYR") - rate).max())
    of_accel, of_gyro = [line for line in summary.splitlines() if "all of this" in line]
    stated = [float(v) for v in (of_accel.split()[-1], *of_gyro.split()[-2:])]
    # The file states the largest of 26 directions: sin(90 - 27) and what a random one can miss.
    for found, told in zip((off, rest, turned), stated, strict=True):
        assert 0.9 < found / told < 1.15, (found, told)


@pytest.mark.parametrize("name", FORMULAS)
def test_the_offsets_are_the_biases_over_temperature(
    name: str, delivered: Path, tmp_path: Path
) -> None:
    file, formula = FORMULAS[name]
    triaxcal.export(delivered, name, tmp_path)
    p = values_of(tmp_path / file)
    temp = np.linspace(*RANGE_DEGC, 41)
    none = np.zeros((41, 3))
    for what, reading in zip(("ACC", "GYR"), read(none, none, temp), strict=True):
        left = np.abs(formula(p, reading, temp, what)).max()
        assert left < 1e-6 * np.abs(reading).max()  # float32 parameters


def test_betaflight_gets_the_trim_alone(delivered: Path, tmp_path: Path) -> None:
    summary = triaxcal.export(delivered, "betaflight", tmp_path).summary
    (trims,) = re.findall(r"acc_calibration = (\S+),1", (tmp_path / "betaflight.txt").read_text())
    codes = BIAS / G / (16.0 / 2**15)
    assert np.abs(np.array([int(v) for v in trims.split(",")]) - codes).max() <= 0.5
    assert "acc_1G of the driver must be 2048, 2048, 2048" in summary
    assert "Nothing of the gyro: Betaflight measures its offset at each start" in summary


# ---- build systems, A2L, image ----


def test_every_layout_has_the_c_of_both_triads(delivered: Path, tmp_path: Path) -> None:
    for name in ("cmake", "make", "zephyr", "platformio", "arduino", "esp-idf", "rust"):
        made = triaxcal.export(delivered, name, tmp_path / name)
        found = {Path(f).name: tmp_path / name / f for f in made.files}
        for file in delivered.glob("imu_left_*"):
            assert found[file.name].read_bytes() == file.read_bytes()
        text = "\n".join(p.read_text() for p in found.values() if p.suffix != ".bin")
        assert "accelerometer S-1" not in text
    properties = (tmp_path / "arduino" / "library.properties").read_text()
    assert "includes=imu_left_calib.h,imu_left_gyro_calib.h,imu_left_imu.h\n" in properties
    rust = (tmp_path / "rust" / "src" / "lib.rs").read_text()
    assert re.search(r"pub use imu_left_imu_[0-9a-f]{8}_apply as imu_left_imu_apply;", rust)


USER = """#include "imu_left_imu.h"
#include "imu_left_calib.h"
#include "imu_left_gyro_calib.h"
imu_left_calib_t accel_calib;
imu_left_gyro_calib_t gyro_calib;
const char *volatile epk;
int main(void) {
    static imu_left_imu_state_t state;
    static const uint8_t image[IMU_LEFT_IMU_FILE_SIZE];
    uint32_t status =
        imu_left_imu_set_temperature(&state, &IMU_LEFT_CALIB, &IMU_LEFT_GYRO_CALIB, 80);
    epk = IMU_LEFT_CALIB_EPK;
    if (imu_left_imu_calib_load(&accel_calib, &gyro_calib, image, sizeof image) == 0) { return 1; }
    return (int)status;
}
"""


@pytest.fixture(scope="module")
def program(delivered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Linked by the make fragment."""
    pytest.importorskip("elftools")
    folder = tmp_path_factory.mktemp("program")
    triaxcal.export(delivered, "make", folder / "imu")
    (folder / "main.c").write_text(USER)
    (folder / "Makefile").write_text(
        "include imu/imu_left.mk\nfw.elf: main.c $(IMU_LEFT_SOURCES)\n"
        "\tgcc -std=c99 -Wall -Werror $(IMU_LEFT_CFLAGS) $^ -o $@\n"
    )
    for command in (["make"], ["./fw.elf"]):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "fw.elf"


def symbols_of(program: Path) -> dict[str, int]:
    listed = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listed.splitlines()]
    return {row[2]: int(row[0], 16) for row in rows if len(row) == 3}


def test_one_a2l_has_both_triads(
    made: triaxcal.ImuFirmware, delivered: Path, program: Path, tmp_path: Path
) -> None:
    text = made.write_a2l(program, tmp_path / "a.a2l").read_text()
    symbols = symbols_of(program)
    starts = {s: a for s, a in symbols.items() if s.endswith("_calib_constants")}
    assert len(starts) == 2
    for symbol, start in starts.items():
        assert f'"{symbol}"\n        DATA FLASH INTERN 0x{start:08X} ' in text
    pattern = (
        r'CHARACTERISTIC (\w+) "[^"]*"\s+VALUE (\w+) \w+ 0 (\w+) .*\s+SYMBOL_LINK "(\w+)" (\d+)'
    )
    found = re.findall(pattern, text)
    assert len({name for name, *_ in found}) == len(found)
    for _, address, _, symbol, offset in found:
        assert int(address, 0) == starts[symbol] + int(offset)
    # The value of a word, by its conversion, is the constant: of both triads, and G.
    image = (delivered / "imu_left_imu.bin").read_bytes()
    at = image.index(b"TRXG")
    scales = {
        name: (float(slope), float(intercept))
        for name, slope, intercept in re.findall(
            r'COMPU_METHOD (\w+) "[^"]*"\s+LINEAR "[^"]*" "[^"]*"\s+COEFFS_LINEAR (\S+) (\S+)', text
        )
    }
    # Header of 16 words: P2's gyro has the terms word, the accelerometer none.
    for name, start, expected in (
        ("IMU_LEFT_s0_origin", 60, 20.0),
        ("IMU_LEFT_GYRO_Gxy", at + 64, np.rad2deg(_sensitivity()[0, 1])),
    ):
        ((_, _, method, _, offset),) = [row for row in found if row[0] == name]
        (word,) = struct.unpack_from("<i", image, start + int(offset))
        slope, intercept = scales[method]
        assert word * slope + intercept == pytest.approx(expected, abs=abs(slope))


def _sensitivity() -> np.ndarray:
    """(rad/s)/g of 9.80665 that is left in the compensated rate: K^-1 D at 20 degC."""
    return np.linalg.solve(np.eye(3) + THETA, BY_FORCE) * (G / LOCAL_G)


def test_variables_of_an_imu_are_two(
    made: triaxcal.ImuFirmware, program: Path, tmp_path: Path
) -> None:
    path = made.write_a2l(program, tmp_path / "b.a2l", variables=("accel_calib", "gyro_calib"))
    symbols, text = symbols_of(program), path.read_text()
    for name in ("accel_calib", "gyro_calib"):
        assert f'"{name}"\n        DATA RAM INTERN 0x{symbols[name]:08X} ' in text
    with pytest.raises(RefusedError) as refusal:
        made.write_a2l(program, tmp_path / "c.a2l", variables=("accel_calib",))
    assert str(refusal.value) == (
        "variable: found accel_calib; expected one for each of imu_left_calib_t, "
        "imu_left_gyro_calib_t"
    )
    assert not (tmp_path / "c.a2l").exists()


def test_the_image_says_whose_it_is(delivered: Path, tmp_path: Path) -> None:
    image = triaxcal.read_image(delivered / "imu_left_imu.bin")
    axes = [part.identity.axes for part in image.parts if part.identity]
    assert axes == ["-acc2, acc1, acc3", "gx, gy, gz"]
    lines = image.summary.splitlines()
    assert sum("S-1" in line for line in lines) == 1
    assert sum("2026-03-30" in line for line in lines) == 1
    for name in ("a.hex", "a.srec", "a.uf2"):
        pytest.importorskip("bincopy")
        image.write(tmp_path / name, 0x0803F000, size=2048)
        assert (tmp_path / name).stat().st_size > len(image.content)


def test_a_calibration_without_a_device_has_no_firmware(tmp_path: Path) -> None:
    old = document()
    del old["firmware"]
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(old))
    for run in (
        lambda: triaxcal.delivered_firmware(tmp_path),
        lambda: triaxcal.export(tmp_path, "px4", tmp_path / "out"),
    ):
        with pytest.raises(RefusedError) as refusal:
            run()
        assert str(refusal.value).startswith(
            f"{path}, firmware: missing: unit.toml has no [device], or an earlier triaxcal wrote "
            "the file; expected the calibration of an IMU with [device]: accel_bits, "
        )
    assert not (tmp_path / "out").exists()
    damaged = document()
    del damaged["firmware"]["device"]["accel_bits"]
    path.write_text(json.dumps(damaged))
    with pytest.raises(RefusedError, match="firmware: damaged: "):
        triaxcal.delivered_firmware(tmp_path)


@pytest.mark.long
def test_what_was_delivered_is_made_again_byte_for_byte(tmp_path: Path) -> None:
    """From a recording: the calibration.json holds all that the C is made of."""
    unit = tmp_path / "IMU-SIM"
    shutil.copytree(SIM, unit, ignore=shutil.ignore_patterns("recording.csv"))
    for name, old, new in (
        ("imu_truth.toml", "minutes_per_axis = 4", "minutes_per_axis = 1.5"),
        ("unit.toml", "0.0078125", "0.125"),
        ("unit.toml", "[device]", "[measured]\ndate = 2026-03-30\n\n[device]"),
    ):
        text = (unit / name).read_text()
        assert old in text
        (unit / name).write_text(text.replace(old, new))
    write_simulated_unit(unit)
    folder = triaxcal.deliver(unit, tmp_path / "build").folder
    again = triaxcal.delivered_firmware(folder)
    for name, content in again.files.items():
        assert (folder / name).read_bytes() == content, name
    identity = triaxcal.read_image(folder / "triax_imu.bin").parts[1].identity
    assert identity is not None
    assert (identity.date, identity.axes[:16]) == ("2026-03-30", "gyro_x_deg_per_s")
    left = triaxcal.delivered_firmware(folder, prefix="left")
    assert left.files["left_imu.bin"] == again.files["triax_imu.bin"]
    assert "SYMBOL_LINK" in (folder / "triax_calib.a2l").read_text()
    for command in (
        ["firmware", str(folder), "--prefix", "left", "--into", str(tmp_path / "left")],
        ["export", str(folder), "--to", "cmake", "--into", str(tmp_path / "cmake")],
    ):
        done = CliRunner().invoke(main, command, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert len(list((tmp_path / "left").iterdir())) == 15
