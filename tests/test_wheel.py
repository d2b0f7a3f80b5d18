"""The wheel carries templates and C, and works outside the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return next(target.glob("*.whl"))


def test_everything_is_in_it(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("templates", "firmware_ref"):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file():
                assert f"triaxcal/_shipped/{folder}/{path.relative_to(ROOT / folder)}" in names
    for path in (ROOT / "toolchain" / "triaxcal").rglob("*.py"):
        assert str(path.relative_to(ROOT / "toolchain")) in names


def test_it_works_outside_the_checkout(wheel: Path, tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    site = next(venv.glob("lib/python*/site-packages"))
    zipfile.ZipFile(wheel).extractall(site)
    # The dependencies of this environment, but not its editable triaxcal.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    code = "import sys; from triaxcal.cli.entry import entry; entry()"
    run = subprocess.run(
        [str(venv / "bin" / "python"), "-c", code, "calib", str(ROOT / "units" / "AT-CHERNIAK")],
        cwd=tmp_path,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    where = subprocess.run(
        [str(venv / "bin" / "python"), "-c", "import triaxcal; print(triaxcal.__file__)"],
        cwd=tmp_path,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert where.startswith(str(site))
    assert (tmp_path / "build" / "AT-CHERNIAK" / "triax_calib.h").is_file()
