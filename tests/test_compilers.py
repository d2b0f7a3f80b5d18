"""Which C compiler is taken, and what `triaxcal doctor` says of it and of everything else."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from triaxcal import RefusedError, installation
from triaxcal.base.tools import TOOLS, MissingToolError
from triaxcal.cli.main import main
from triaxcal.codegen import compilers
from triaxcal.codegen.compiler import compile_library
from triaxcal.codegen.compilers import find_compiler

GCC = shutil.which("gcc")
assert GCC is not None


def put_compiler(folder: Path, name: str, says: str = "") -> Path:
    """A program that passes its arguments on to gcc, or only says something."""
    folder.mkdir(exist_ok=True)
    program = folder / name
    passed = f"echo {says}" if says else f'exec {shlex.quote(str(GCC))} "$@"'
    program.write_text(f"#!/bin/sh\n{passed}\n", encoding="utf-8")
    program.chmod(0o755)
    return program


@pytest.fixture
def nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A PATH without programs, and no CC."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda _: None)
    return folder


def test_the_order(nothing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RefusedError) as refusal:
        find_compiler()
    assert "no gcc, no clang, no ziglang; install one: sudo apt-get install gcc" in str(
        refusal.value
    ).replace("look for gcc; Debian's packages are", "sudo apt-get install")
    assert "pip install 'triaxcal[cc]'" in str(refusal.value)
    spec = type("Spec", (), {"origin": "/site-packages/ziglang/__init__.py"})()
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda _: spec)
    assert find_compiler().command == (sys.executable, "-P", "-m", "ziglang", "cc")
    clang = put_compiler(nothing, "clang", "x86_64-pc-windows-msvc")
    assert find_compiler().command == (str(clang),)
    with monkeypatch.context() as windows:
        windows.setattr(compilers.sys, "platform", "win32")
        assert find_compiler().name == "ziglang"
    gcc = put_compiler(nothing, "gcc")
    assert find_compiler().command == (str(gcc),)
    spec.origin = None
    for program in (gcc, clang):
        program.unlink()
    with pytest.raises(RefusedError):  # a folder named ziglang is no package
        find_compiler()


def test_what_cc_names(nothing: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    put_compiler(nothing, "gcc")
    spaced = put_compiler(tmp_path / "my tools", "cc-13")
    for chosen, name, command in (
        (str(spaced), "cc-13", (str(spaced),)),
        (f"'{spaced}' -O0", "cc-13 -O0", (str(spaced), "-O0")),
        (f"{sys.executable} -m ziglang cc", f"{Path(sys.executable).name} -m ziglang cc",
         (sys.executable, "-m", "ziglang", "cc")),
        ("  ", "gcc", (str(nothing / "gcc"),)),
    ):  # fmt: skip
        monkeypatch.setenv("CC", chosen)
        assert (find_compiler().name, find_compiler().command) == (name, command)
    for chosen, words in (
        ("nothing-there", "CC: found 'nothing-there', and there is no program 'nothing-there'"),
        ("cl.exe /W4", "expected a compiler with the options of gcc"),
        ("gcc 'open", "No closing quotation; expected a command"),
        (str(tmp_path), "there is no program"),
    ):
        monkeypatch.setenv("CC", chosen)
        with pytest.raises(RefusedError, match=re.escape(words)):
            find_compiler()


def test_a_compilation_by_what_cc_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CC", str(put_compiler(tmp_path / "my tools", "my cc")))
    source = tmp_path / "seven.c"
    source.write_text("int seven(void);\nint seven(void) { return 7; }\n", encoding="utf-8")
    made = compile_library([source], tmp_path / "seven")
    assert made.load().seven() == 7
    assert made.library.name == "seven.so"
    assert made.compiler.called("12.2.0") == "my cc 12.2.0"
    assert made.compiler.called("Clang 22") == "my cc, Clang 22"
    source.write_text("int seven(void) { return eight; }\n", encoding="utf-8")
    with pytest.raises(RefusedError, match=r"my cc: .*error.*CC names another compiler"):
        compile_library([source], tmp_path / "eight").load()


def test_doctor_without_a_compiler(nothing: Path) -> None:
    done = CliRunner().invoke(main, ["doctor"])
    assert done.exit_code == 1
    assert re.search(r"^  C compiler +MISSING ", done.output, re.MULTILINE)
    assert re.search(r"^  C compiler +.*pip install 'triaxcal\[cc\]'$", done.output, re.MULTILINE)
    assert re.search(r"^  gappa +- ", done.output, re.MULTILINE)
    assert done.output.endswith("triaxcal calib cannot work: see what is MISSING\n")
    put_compiler(nothing, "gcc", "nothing of use")
    found = json.loads(CliRunner().invoke(main, ["doctor", "--json"]).output)
    (chosen,) = [p for p in found["parts"] if p["group"] == "C compiler" and p["needed"]]
    assert not found["works"]
    assert "made no library that loads" in chosen["purpose"]


def test_doctor_says_what_there_is() -> None:
    found = installation()
    assert found.works
    parts = {part.name: part for part in found.parts}
    assert {"numpy", "scipy", "jinja2", "click", "rich"} <= set(parts)
    assert {*TOOLS, "plot", "SocketCAN"} <= {*parts, "gcc", "clang"}
    assert all(part.purpose for part in found.parts if part.group != "every command")
    for name, tool in TOOLS.items():
        if shutil.which(name) is None:
            with pytest.raises(MissingToolError, match=f"{name} not found; "):
                tool.find()
    missing = replace(parts["numpy"], found="")
    broken = replace(found, parts=(missing,))
    assert not broken.works
    assert f"{os.path.basename(sys.executable)} -m pip install numpy" in broken.summary  # noqa: PTH119
