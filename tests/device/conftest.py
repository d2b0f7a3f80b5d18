"""The slave and the store in memory, and the example node, built for one shape."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from builds import PROVENANCE, Builds, Built
from plans import SENSOR
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.identity import with_identity

HERE = Path(__file__).parent
XCP = shipped("firmware_ref") / "xcp"
SANITIZED = ("-fsanitize=undefined", "-fno-sanitize-recover=all")


def file_of(b: Built, serial: str) -> bytes:
    """triax_calib.bin of a unit with that serial number."""
    return with_identity(b.image, SENSOR, replace(PROVENANCE, serial=serial))


def compile_with(b: Built, out: Path, *more: str | Path) -> Path:
    sources = [*sorted(XCP.glob("*.c")), b.folder / "triax_comp.c"]
    command = ["gcc", *FLAGS, f"-I{b.folder}", f"-I{XCP}", *sources, *more, "-o", out]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="session")
def unit(built: Builds) -> Built:
    return built["direct-checked"]


@pytest.fixture(scope="session")
def harness(unit: Built, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    out = tmp_path_factory.mktemp("harness") / "harness.so"
    options = ("-shared", "-fPIC", *SANITIZED)
    return ctypes.CDLL(str(compile_with(unit, out, HERE / "harness.c", *options)))
