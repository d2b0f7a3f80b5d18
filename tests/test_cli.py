"""What a user sees: one line, an exit code, and nothing half-written."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import pytest

from triaxcal.cli.main import run as run_command

ROOT = Path(__file__).resolve().parents[1]
TRIAXCAL = [sys.executable, "-m", "triaxcal"]
FILES = [
    "calibration.json",
    "passport.html",
    "passport.json",
    "residuals.svg",
    "triax_calib.a2l",
    "triax_calib.bin",
    "triax_calib.c",
    "triax_calib.h",
    "triax_comp.c",
    "triax_comp.h",
    "triax_selftest.c",
    "triax_selftest.h",
    "verification.json",
]


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder with a copy of the shipped units."""
    shutil.copytree(ROOT / "units", tmp_path / "units")
    return tmp_path


@dataclass(frozen=True)
class Done:
    """What a command left: its exit code and what it printed."""

    returncode: int
    stdout: str
    stderr: str


def run(*arguments: str, cwd: Path, environment: dict[str, str] | None = None) -> Done:
    """The command in this process: Python and its imports take longer than most commands."""
    printed, complained, code = StringIO(), StringIO(), 0
    with (
        chdir(cwd),
        patch.dict(os.environ, environment or {}),
        patch.object(sys, "argv", ["triaxcal", *arguments]),
        redirect_stdout(printed),
        redirect_stderr(complained),
    ):
        try:
            run_command()
        except SystemExit as leaving:
            code = leaving.code if isinstance(leaving.code, int) else 0
    return Done(code, printed.getvalue(), complained.getvalue())


def run_alone(*arguments: str, cwd: Path) -> Done:
    """The command as a process of its own."""
    command = [*TRIAXCAL, *arguments]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    return Done(done.returncode, done.stdout, done.stderr)


def refused(cwd: Path, *arguments: str, environment: dict[str, str] | None = None) -> str:
    """The one line of a refusal; nothing may have been written."""
    result = run(*arguments, cwd=cwd, environment=environment)
    assert result.returncode == 1, result.stderr
    assert result.stdout == ""
    line, rest = result.stderr.split("\n", 1)
    assert rest == ""
    assert line.startswith("triaxcal: ")
    assert "Traceback" not in line
    assert not (cwd / "build").is_dir() or not list((cwd / "build").iterdir())
    return line


def edit(bench: Path, name: str, change: Callable[[str], str]) -> None:
    path = bench / "units" / "AT-CHERNIAK" / name
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")


def rows(change: Callable[[list[str]], list[str]]) -> Callable[[str], str]:
    """A change of the measurements' rows, by position and temperature."""
    return lambda text: "\n".join(change(text.rstrip("\n").split("\n"))) + "\n"


def without(start: str) -> Callable[[str], str]:
    return rows(lambda lines: [line for line in lines if not line.startswith(start)])


def renamed(**names: str) -> Callable[[str], str]:
    """Rows at 70 degC renamed."""

    def change(lines: list[str]) -> list[str]:
        return [
            names[line[:3]] + line[3:] if line[3:7] == ",70," and line[:3] in names else line
            for line in lines
        ]

    return rows(change)


def scaled(factor: float, start: str = "TP") -> Callable[[str], str]:
    def scale(line: str) -> str:
        if not line.startswith(start):
            return line
        position, temp, *cells = line.split(",")
        return ",".join([position, temp, *(repr(float(c) * factor) for c in cells)])

    return rows(lambda lines: [scale(line) for line in lines])


def cell(text: str) -> Callable[[str], str]:
    """Ux of TP3 at 70 degC replaced."""

    def change(line: str) -> str:
        parts = line.split(",")
        return ",".join([*parts[:2], text, *parts[3:]]) if line.startswith("TP3,70") else line

    return rows(lambda lines: [change(line) for line in lines])


MEASUREMENTS = "measurements.csv"
UNIT = "unit.toml"
BAD_INPUT = {
    "missing position": (MEASUREMENTS, without("TP3,70"), ["TP3 missing at 70 degC"]),
    "doubled position": (MEASUREMENTS, renamed(TP3="TP4"), ["TP4 twice", "rows 18 and 19"]),
    "unknown position": (MEASUREMENTS, renamed(TP3="TP9"), ["row 18", "'TP9'", "TP1 to TP6"]),
    "no T0": (
        MEASUREMENTS,
        rows(lambda lines: [line for line in lines if line[3:7] != ",20,"]),
        ["no dwells at T0 = 20 degC", "-40, 70 degC", "t0_degc"],
    ),
    "five positions": (MEASUREMENTS, without("TP6,-40"), ["TP6 missing at -40 degC"]),
    "NaN": (MEASUREMENTS, cell("nan"), ["row 18", "ux_v", "'nan'"]),
    "empty": (MEASUREMENTS, cell(""), ["row 18", "ux_v"]),
    "text": (MEASUREMENTS, cell("ok"), ["row 18", "ux_v", "'ok'"]),
    "exchange on an axis": (
        MEASUREMENTS,
        renamed(TP1="TP3", TP3="TP1"),
        ["TP1 and TP3 look exchanged at 70 degC"],
    ),
    "exchange of axes": (
        MEASUREMENTS,
        renamed(TP1="TP6", TP6="TP1"),
        ["TP1 and TP6 look exchanged at 70 degC"],
    ),
    "mV for V": (MEASUREMENTS, scaled(1000.0), ["mV"]),
    "V for mV": (
        MEASUREMENTS,
        lambda text: text.replace("ux_v,uy_v,uz_v", "ux_mv,uy_mv,uz_mv"),
        ["V taken for mV"],
    ),
    "beyond the converter": (MEASUREMENTS, cell("2.6"), ["row 18", "2.6", "2.5"]),
    "singular": (
        MEASUREMENTS,
        rows(
            lambda lines: [
                ",".join([*line.split(",")[:3], *[line.split(",")[2]] * 2])
                if line.startswith("TP")
                else line
                for line in lines
            ]
        ),
        ["triaxcal: "],
    ),
    "order": (
        UNIT,
        lambda text: text.replace(
            "[thermal]", '[thermal]\nmodel = "polynomial"\norder = 3'
        ),
        ["order", "3", "4", "2"],
    ),
    "unknown key": (UNIT, lambda text: text + "\n[limits]\nat_t0 = 1\n", ["at_t0", "at_t0_g"]),
    "wrong type": (
        UNIT,
        lambda text: text.replace("bits = 32", 'bits = "32"'),
        ["adc", "bits", "32"],
    ),
    "duplicate serial": (
        UNIT,
        lambda text: text.replace('serial = "AT-CHERNIAK"', 'serial = "AT-SIM-001"'),
        ["AT-SIM-001", "AT-SIM"],
    ),
    "limits": (
        UNIT,
        lambda text: text
        + '\n[compensation]\nmethod = "additive-simplified"\n[limits]\nover_range_g = 1e-4\n',
        ["| |a| - g |", "row", "limits.over_range_g"],
    ),
    "too fine an output": (
        UNIT,
        lambda text: text.replace("full_scale_v = 2.5", "full_scale_v = 20")
        + "\n[compensation]\noutput_q = 30\n",
        ["declared raw range", "compensation.output_q"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_INPUT)
def test_bad_input_is_refused_in_one_line(bench: Path, case: str) -> None:
    name, change, words = BAD_INPUT[case]
    edit(bench, name, change)
    line = refused(bench, "calib", "units/AT-CHERNIAK")
    for word in words:
        assert word in line


def test_a_process_of_its_own_says_the_same(bench: Path) -> None:
    edit(bench, MEASUREMENTS, cell("nan"))
    for arguments in (("calib", "units/AT-CHERNIAK"), ("calib", "units/NOPE"), ("--version",)):
        assert run_alone(*arguments, cwd=bench) == run(*arguments, cwd=bench)


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("units/NOPE", ["no such unit", "AT-CHERNIAK, AT-SIM"]),
        ("units/../units", ["'..'"]),
        ("units/a b", ["'a b'", "A-Z a-z 0-9 - _"]),
        ('units/a"b', ["A-Z a-z 0-9 - _"]),
    ],
)
def test_a_unit_that_is_none(bench: Path, unit: str, words: list[str]) -> None:
    line = refused(bench, "calib", unit)
    for word in words:
        assert word in line


def test_no_compiler(bench: Path) -> None:
    line = refused(bench, "calib", "units/AT-CHERNIAK", environment={"PATH": str(bench)})
    assert "C compiler: not found: no gcc, no clang, no ziglang" in line
    assert "apt-get install gcc" in line


def test_a_build_folder_that_cannot_be_written(bench: Path) -> None:
    (bench / "build").write_text("in the way")
    line = refused(bench, "calib", "units/AT-CHERNIAK")
    assert "build" in line
    assert "cannot be written" in line


def test_usage_is_exit_code_2(bench: Path) -> None:
    for arguments in ([], ["calib"], ["bogus"], ["simulate", "units/AT-SIM", "--seed", "x"]):
        result = run(*arguments, cwd=bench)
        assert result.returncode == 2
        assert "Traceback" not in result.stderr


def test_summary_and_files(bench: Path) -> None:
    result = run_alone("calib", "units/AT-CHERNIAK", cwd=bench)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    assert sorted(p.name for p in (bench / "build" / "AT-CHERNIAK").iterdir()) == FILES
    assert [p.name for p in (bench / "build").iterdir()] == ["AT-CHERNIAK"]
    for words in (
        "proven error",
        "bit for bit",
        "not shown to be within the limits",
        "build/AT-CHERNIAK/",
        *FILES,
    ):
        assert words in " ".join(result.stdout.split())
    assert max(map(len, result.stdout.splitlines())) <= 80


def test_a_refusal_leaves_the_last_result(bench: Path) -> None:
    assert run("calib", "units/AT-CHERNIAK", cwd=bench).returncode == 0
    before = {p.name: p.read_bytes() for p in (bench / "build" / "AT-CHERNIAK").iterdir()}
    edit(bench, MEASUREMENTS, without("TP3,70"))
    assert run("calib", "units/AT-CHERNIAK", cwd=bench).returncode == 1
    after = {p.name: p.read_bytes() for p in (bench / "build" / "AT-CHERNIAK").iterdir()}
    assert after == before


def test_another_run_replaces_the_result(bench: Path) -> None:
    target = bench / "build" / "AT-CHERNIAK"
    assert run("calib", "units/AT-CHERNIAK", cwd=bench).returncode == 0
    (target / "triax_calib.h").write_text("damaged")
    assert run("calib", "units/AT-CHERNIAK", cwd=bench).returncode == 0
    assert "TRIAX_CALIB" in (target / "triax_calib.h").read_text()
    assert [p.name for p in (bench / "build").iterdir()] == ["AT-CHERNIAK"]


def test_nobody_elses_files_are_replaced(bench: Path) -> None:
    # The unit's own folder, named as the place to build in.
    before = sorted(p.name for p in (bench / "units" / "AT-CHERNIAK").iterdir())
    result = run("calib", "units/AT-CHERNIAK", "--build", "units", cwd=bench)
    assert result.returncode == 1
    assert "units/AT-CHERNIAK: holds 'measurements.csv'" in result.stderr
    assert sorted(p.name for p in (bench / "units" / "AT-CHERNIAK").iterdir()) == before
    # A symbolic link.
    (bench / "build").mkdir()
    (bench / "build" / "AT-CHERNIAK").symlink_to(bench / "units")
    result = run("calib", "units/AT-CHERNIAK", cwd=bench)
    assert result.returncode == 1
    assert "is not a folder of results" in result.stderr
    assert (bench / "build" / "AT-CHERNIAK").is_symlink()


def in_thermal(text: str) -> Callable[[str], str]:
    return lambda unit: unit.replace("[thermal]", f"[thermal]\n{text}")


def test_a_range_without_dwells(bench: Path) -> None:
    edit(bench, UNIT, in_thermal("range_degc = [30, 40]"))
    line = refused(bench, "calib", "units/AT-CHERNIAK")
    assert "no dwell of" in line
    assert "30 to 40 degC" in line


def test_a_range_without_t0_has_no_limit_at_t0(bench: Path) -> None:
    edit(bench, UNIT, in_thermal("range_degc = [30, 70]"))
    result = run("calib", "units/AT-CHERNIAK", cwd=bench)
    assert result.returncode == 0, result.stderr
    verdict = result.stdout.partition("verdict ")[2]
    assert "over the range" in verdict
    assert "at T0" not in verdict.partition("files ")[0]
    assert "12 of the dwells lie outside the range" in " ".join(result.stdout.split())


def test_a_wrong_reading_is_blamed_and_not_another(bench: Path) -> None:
    # TP3 at 70 degC: 0.5484 V in z becomes 0.5584 V, 18 mg.
    edit(bench, MEASUREMENTS, lambda text: text.replace("0.54755949", "0.55755949"))
    line = refused(bench, "calib", "units/AT-CHERNIAK")
    assert "rows 16 and 18" in line
    assert "mean of TP1 and TP3" in line
    assert "in output z" in line


def test_coarse_output_is_blamed_on_the_settings(bench: Path) -> None:
    # g = 1.00136: at 1/256 g a code it becomes 1, 1.36 mg off.
    edit(bench, UNIT, lambda text: text.replace("9.80665", "9.82"))
    edit(bench, UNIT, lambda text: text + "\n[compensation]\noutput_q = 8\n")
    line = refused(bench, "calib", "units/AT-CHERNIAK")
    assert "LSB is 3.91 mg" in line
    assert "output_q" in line


def test_a_failing_compiler(bench: Path) -> None:
    fake = bench / "bin"
    fake.mkdir()
    for script, words in (
        ("#!/bin/sh\nexit 0\n", "made no library that loads"),
        ("#!/bin/sh\necho x.c:1: error: no >&2\nexit 1\n", "x.c:1: error: no"),
        ("#!/nonexistent\n", "cannot be run"),
    ):
        (fake / "gcc").write_text(script)
        (fake / "gcc").chmod(0o755)
        line = refused(bench, "calib", "units/AT-CHERNIAK", environment={"PATH": f"{fake}:/bin"})
        assert words in line


@pytest.mark.parametrize("delay_s", [0.1, 0.4, 0.8, 1.2])
def test_interrupt_leaves_all_or_nothing(bench: Path, delay_s: float) -> None:
    process = subprocess.Popen(
        [*TRIAXCAL, "calib", "units/AT-CHERNIAK"],
        cwd=bench,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    time.sleep(delay_s)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate()
    build = bench / "build"
    if process.returncode == 0:  # it was quicker
        assert sorted(p.name for p in (build / "AT-CHERNIAK").iterdir()) == FILES
        return
    # Before Python has come as far as our code its own message is all there can be.
    assert process.returncode in (1, -signal.SIGINT)
    started = "importlib._bootstrap" not in errors
    assert process.returncode != 1 or not started or "interrupted" in errors
    assert not build.exists() or not list(build.iterdir())


def test_simulate_writes_the_shipped_measurements(bench: Path) -> None:
    path = bench / "units" / "AT-SIM" / MEASUREMENTS
    shipped = path.read_bytes()
    path.unlink()
    result = run("simulate", "units/AT-SIM", cwd=bench)
    assert (result.returncode, result.stderr) == (0, "")
    assert path.read_bytes() == shipped


def test_make_names_what_is_missing() -> None:
    make = shutil.which("make")
    if make is None or not (ROOT / ".venv" / ".installed").exists():
        pytest.skip("needs make and the checkout's own .venv")
    result = subprocess.run(
        [make, "calib-header"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode != 0
    assert "UNIT is missing" in result.stderr
    assert "AT-CHERNIAK" in result.stderr
