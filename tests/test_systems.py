"""The commands without what Windows and macOS lack, with Windows' ends of lines and encoding."""

from __future__ import annotations

import _ctypes
import ast
from pathlib import Path

import pytest

from systems import RUN, SYSTEMS, python
from triaxcal import RefusedError, write_first_file
from triaxcal.base.extras import quoted
from triaxcal.codegen.compiler import (
    library_flags,
    library_folder,
    library_suffix,
    start_reference,
)
from triaxcal.delivery.unit import Delivery
from triaxcal.unit import folder
from triaxcal.unit.folder import find_unit
from triaxcal.unit.recordingfile import is_in_folder

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "toolchain" / "triaxcal"
IMPORT_ALL = """
import importlib, pkgutil
import triaxcal as package
for module in pkgutil.walk_packages(package.__path__, "triaxcal."):
    if module.name not in ("triaxcal.__main__",):
        importlib.import_module(module.name)
        print(module.name)
"""


@pytest.mark.long
@pytest.mark.parametrize("system", SYSTEMS)
def test_every_module_is_imported(system: str) -> None:
    done = python(SYSTEMS[system] + IMPORT_ALL)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.split()) > 600


COMMANDS = (
    "example", "example AT-SIM", "example IMU-SIM", "doctor", "doctor --json", "init units/SN-7",
    "schema imu", "calib AT-SIM", "diagnose AT-SIM", "export AT-SIM --to cmake",
    "firmware AT-SIM --prefix left", "image build/AT-SIM/triax_calib.bin", "calib AT-SIM",
    "simulate AT-SIM --series 2 --into series",
    "batch series/AT-SIM-0001 series/AT-SIM-0002 --jobs 2",
    "simulate AT-SIM",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("system", ["macOS", "Windows"])
def test_the_commands_work(system: str, tmp_path: Path, delivered: dict[str, Delivery]) -> None:
    here = tmp_path / "with a space"
    here.mkdir()
    done = python(SYSTEMS[system] + RUN, "\n".join(COMMANDS), here)
    ends = [line for line in done.stdout.splitlines() if line.startswith("exit")]
    assert ends == ["exit 0"] * len(COMMANDS), done.stdout[-3000:] + done.stderr[-3000:]
    assert "Traceback" not in done.stderr
    made = here / "build" / "AT-SIM"
    firmware = delivered["AT-SIM"].firmware.files
    assert {name: (made / name).read_bytes() for name in firmware} == firmware
    shipped = (ROOT / "units" / "AT-SIM" / "measurements.csv").read_bytes()
    assert (here / "AT-SIM" / "measurements.csv").read_bytes() == shipped


def text_without_encoding(tree: ast.AST) -> list[int]:
    """Lines where a text is read or written in the encoding of the system."""
    lines = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or any(k.arg == "encoding" for k in node.keywords):
            continue
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        given = [*node.args, *(k.value for k in node.keywords if k.arg == "mode")]
        modes = [a.value for a in given if isinstance(a, ast.Constant)]
        binary = any(isinstance(mode, str) and "b" in mode for mode in modes)
        of_files = isinstance(called, ast.Name) or (name == "open" and not node.args)
        if name in ("read_text", "write_text") or (name == "open" and of_files and not binary):
            lines.append(node.lineno)
    return lines


@pytest.mark.long
def test_texts_have_an_encoding() -> None:
    found = {
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in PACKAGE.rglob("*.py")
        for line in text_without_encoding(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert sorted(found) == []


@pytest.mark.parametrize("name", ["CON", "nul", "Com1", "LPT9", "aux"])
def test_a_device_of_windows_is_no_unit(tmp_path: Path, name: str) -> None:
    with pytest.raises(RefusedError, match="a device of Windows; choose another name"):
        write_first_file(tmp_path / name)
    assert not (tmp_path / name).exists()
    assert write_first_file(tmp_path / f"{name}1")[0].exists()


def test_a_unit_in_other_letters_where_they_are_one_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_first_file(tmp_path / "SN-1")
    find_unit(tmp_path / "SN-1")
    is_unit = folder._is_unit
    # As on Windows: a folder is there by any case of its name.
    monkeypatch.setattr(folder, "_is_unit", lambda p: is_unit(p.with_name(p.name.upper())))
    assert find_unit(tmp_path / "SN-1")
    with pytest.raises(RefusedError, match="by upper and lower case; expected SN-1"):
        find_unit(tmp_path / "sn-1")


@pytest.mark.parametrize(
    "name", ["C:\\logs\\a.csv", "C:/logs/a.csv", "\\\\server\\a.csv", "\\a.csv", "..\\a.csv"]
)
def test_a_recording_elsewhere_on_windows_is_refused(name: str) -> None:
    assert not is_in_folder(name)
    assert is_in_folder("logs\\a.csv")


def test_the_library_of_each_system() -> None:
    assert [library_suffix(s) for s in ("linux", "darwin", "win32")] == [".so", ".dylib", ".dll"]
    assert library_flags("win32") == ("-shared",)
    assert library_flags("darwin") == library_flags("linux") == ("-shared", "-fPIC")


def test_windows_gives_a_library_back_before_its_folder_goes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[tuple[int, bool]] = []
    with library_folder() as outer:
        monkeypatch.setattr(
            _ctypes, "FreeLibrary", lambda h: given.append((h, inner.exists())), raising=False
        )
        with library_folder() as inner:
            library = start_reference(inner).load()
            other = start_reference(outer).load()
        assert given == [(library._handle, True)]
        assert not inner.exists()
    assert [handle for handle, _ in given] == [library._handle, other._handle]


def test_a_command_to_copy_is_quoted_for_its_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    assert quoted("triaxcal[cc]") == "'triaxcal[cc]'"
    assert quoted("AT-SIM") == "AT-SIM"
    monkeypatch.setattr("triaxcal.base.extras.os.name", "nt")
    assert quoted("triaxcal[cc]") == "triaxcal[cc]"  # cmd.exe has no other meaning for brackets
    assert quoted("a b") == '"a b"'


BARE = """
import sys
for name in ("asammdf", "bincopy", "can", "cantools", "cryptography", "distributed", "elftools",
             "h5py", "lxml", "matplotlib", "openpyxl", "pyarrow", "pymavlink", "pymodbus", "pyulog",
             "pyvisa", "pyxcp", "rosbags", "serial", "signxml", "ziglang"):
    sys.modules[name] = None
from triaxcal.batch.toolchain import toolchain
from triaxcal.exports.registry import TARGETS
from triaxcal.readings.format import FORMATS
from triaxcal.targets.cores.registry import CORES
print(toolchain(), *(len(list(r)) for r in (FORMATS, TARGETS, CORES)))
import triaxcal
print(triaxcal.installation().works)
"""


@pytest.mark.long
def test_every_registry_is_read_without_any_optional_package() -> None:
    done = python(BARE)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1] == "True"
