"""The wheel in environments of its own: lowest and highest versions, and no compiler but ziglang's.

pip fetches what it needs. Where it cannot, the tests are skipped, but not in CI.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from triaxcal.delivery.unit import Delivery

ROOT = Path(__file__).resolve().parents[1]
UNIT = "AT-SIM"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = tuple(filter(None, os.environ.get("TRIAXCAL_PYTHONS", sys.executable).split(os.pathsep)))
"""Interpreters to test with."""

pytestmark = pytest.mark.slow


def lowest(requirement: str) -> str:
    """The lowest version that a requirement allows."""
    found = re.match(r"([A-Za-z0-9._-]+)>=([0-9.]+)", requirement)
    assert found, f"{requirement}: no lower bound"
    return f"{found[1]}=={found[2]}"


def minor(python: str) -> str:
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    return subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout


class Fresh:
    """An environment with the wheel and nothing of ours."""

    def __init__(self, python: str, folder: Path, *packages: str) -> None:
        self.folder = folder
        subprocess.run([python, "-m", "venv", str(folder)], check=True)
        self.bin = folder / ("Scripts" if os.name == "nt" else "bin")
        self.environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "CC")}
        done = self.run(
            "python", "-m", "pip", "install", "-q", "--disable-pip-version-check",
            "--no-compile", "--only-binary", ":all:", *packages,
        )  # fmt: skip
        if "from versions: none" in done.stderr and "CI" not in os.environ:
            pytest.skip(f"pip cannot install {packages}: {done.stderr[-500:]}")
        assert done.returncode == 0, done.stderr

    def run(
        self, program: str, *arguments: str, path: str = ""
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(self.bin / program), *arguments], cwd=self.folder, capture_output=True, text=True,
            env=self.environment | ({"PATH": path} if path else {}), check=False,
        )  # fmt: skip

    def calibrated(self, path: str = "") -> dict[str, bytes]:
        """C and image of the example, made in this environment."""
        for command in (("example", UNIT), ("calib", UNIT)):
            done = self.run("triaxcal", *command, path=path)
            assert done.returncode == 0, done.stdout + done.stderr
        made = self.folder / "build" / UNIT
        return {p.name: p.read_bytes() for p in made.iterdir() if p.suffix in (".c", ".h", ".bin")}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> str:
    target = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return str(next(target.glob("*.whl")))


@pytest.fixture(scope="module")
def ours(delivered: dict[str, Delivery]) -> dict[str, bytes]:
    """The same files by the environment of the tests."""
    files = delivered[UNIT].firmware.files
    return {n: c for n, c in files.items() if Path(n).suffix in (".c", ".h", ".bin")}


@pytest.mark.parametrize("python", PYTHONS)
def test_highest_versions(python: str, wheel: str, ours: dict[str, bytes], tmp_path: Path) -> None:
    fresh = Fresh(python, tmp_path, wheel)
    assert fresh.calibrated() == ours
    said = fresh.run("triaxcal", "doctor")
    assert said.returncode == 0
    assert re.search(r"^  plot +- .*missing: matplotlib$", said.stdout, re.MULTILINE), said.stdout
    assert "triaxcal calib works" in said.stdout


@pytest.mark.parametrize("python", PYTHONS)
def test_lowest_versions(python: str, wheel: str, ours: dict[str, bytes], tmp_path: Path) -> None:
    if f">={minor(python).strip()}" != PROJECT["requires-python"]:
        pytest.skip("the lowest numpy and scipy have no wheels for a later Python than the lowest")
    fresh = Fresh(python, tmp_path, wheel, *map(lowest, PROJECT["dependencies"]))
    assert fresh.calibrated() == ours


@pytest.mark.parametrize("python", PYTHONS)
def test_no_compiler_but_that_of_ziglang(
    python: str, wheel: str, ours: dict[str, bytes], tmp_path: Path
) -> None:
    fresh = Fresh(python, tmp_path, f"{wheel}[cc]")
    nothing = tmp_path / "no-programs"
    nothing.mkdir()
    assert shutil.which("gcc", path=str(nothing)) is None
    assert fresh.calibrated(str(nothing)) == ours
    results = (tmp_path / "build" / UNIT / "verification.json").read_text(encoding="utf-8")
    assert re.search(r'"compiler": "ziglang, Clang \d', results)
