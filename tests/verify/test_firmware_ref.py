"""The handwritten C of the device: MISRA by cppcheck, and the compilers of small cores."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import WARNINGS
from triaxcal.verify.cppcheck import CPPCHECK, OPTIONS
from triaxcal.verify.tools import run
from verify.conftest import needs

XCP = shipped("firmware_ref") / "xcp"
SOURCES = sorted(XCP.glob("*.c"))
FROM_THE_COMPILER = {"memset", "memcpy", "strlen"}
"""What gcc may call where C has a loop."""


@needs("cppcheck")
def test_cppcheck_finds_nothing() -> None:
    answer = run([CPPCHECK.find(), *OPTIONS, *(path.name for path in SOURCES)], XCP)
    assert answer.code == 0
    assert answer.text.strip() == ""


@needs("cppcheck")
def test_cppcheck_would_find(tmp_path: Path) -> None:
    for path in XCP.iterdir():
        shutil.copy(path, tmp_path)
    source = tmp_path / "triax_store.c"
    text = source.read_text()
    source.write_text(text.replace("if ((unit == 0u) ||", "if (unit == 0u ||"))
    assert source.read_text() != text
    answer = run([CPPCHECK.find(), *OPTIONS, source.name], tmp_path)
    assert "misra-c2012-12.1" in answer.text


@pytest.mark.parametrize("compiler", ["arm-none-eabi-gcc", "avr-gcc", "clang", "g++"])
def test_other_compilers(compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    warnings = WARNINGS
    if compiler == "g++":
        warnings = ("-std=c++11", *WARNINGS[1:], "-xc++")
    for source in SOURCES:
        made = tmp_path / f"{source.stem}.o"
        command = [compiler, *warnings, "-Os", "-c", str(source), "-o", str(made)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@needs("arm-none-eabi-gcc")
def test_it_calls_no_library(tmp_path: Path) -> None:
    objects = []
    for source in SOURCES:
        objects.append(str(tmp_path / f"{source.stem}.o"))
        command = ["arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb", "-Os", "-c", str(source)]
        subprocess.run([*command, "-o", objects[-1]], check=True)
    listing = ["arm-none-eabi-nm", *objects]
    names = subprocess.run(listing, capture_output=True, text=True, check=True).stdout
    words = [line.split() for line in names.splitlines() if line]
    defined = {row[-1] for row in words if row[0] not in ("U", "00000000:")}
    assert {row[-1] for row in words if row[0] == "U"} - defined <= FROM_THE_COMPILER
