"""The wheel carries templates and C, and works outside the checkout."""

from __future__ import annotations

import email
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import triaxcal as api
from triaxcal.base.extras import EXTRAS

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (
    "toolchain", "templates", "firmware_ref", "rig", "units", "docs", "examples", "tests", "bench",
    "fuzz",
)  # fmt: skip
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


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the wheel, and the dependencies of this one."""
    venv = tmp_path_factory.mktemp("installed") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    site = next(venv.glob("lib/python*/site-packages"))
    zipfile.ZipFile(wheel).extractall(site)
    # Not its editable triaxcal: a .pth file in a folder that a .pth file names is not read.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    return venv / "bin" / "python"


def triaxcal(python: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(python), "-m", "triaxcal", *arguments], cwd=folder, env=ENVIRONMENT,
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_units_in_it_are_those_of_the_checkout(wheel: Path) -> None:
    prefix = "triaxcal/_shipped/units/"
    with zipfile.ZipFile(wheel) as opened:
        names = [name for name in opened.namelist() if name.startswith(prefix)]
        inside = {name.removeprefix(prefix): opened.read(name) for name in names}
    ours = {
        str(path.relative_to(ROOT / "units")): path.read_bytes()
        for path in (ROOT / "units").glob("*/*")
        if path.is_file() and path.name != "recording.csv"
    }
    assert inside == ours


@pytest.mark.long
def test_the_first_commands_of_its_page(installed: Path, tmp_path: Path) -> None:
    """An empty folder and nothing but the wheel: the commands print what the page shows."""
    where = triaxcal(installed, tmp_path, "doctor")
    assert str(installed.parent.parent) in where.stdout.splitlines()[0], where.stdout + where.stderr
    page = (ROOT / "PACKAGE.md").read_text(encoding="utf-8")
    console = re.findall(r"```console\n(.*?)```", page, re.DOTALL)
    assert len(console) == 1
    for part in re.split(r"^\$ triaxcal ", console[0], flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        done = triaxcal(installed, tmp_path, *command.split())
        assert done.returncode == 0, done.stderr
        pattern = ".*".join(re.escape(piece) for piece in shown.split("...\n"))
        assert re.fullmatch(pattern, done.stdout, re.DOTALL), done.stdout
    again = triaxcal(installed, tmp_path, "example", "AT-SIM")
    assert again.returncode == 1
    assert "AT-SIM: exists already; expected nothing there: no file is overwritten" in again.stderr
    (python,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    ran = subprocess.run(
        [str(installed), "-c", python], cwd=tmp_path, env=ENVIRONMENT, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    made = (tmp_path / "build" / "AT-SIM" / "triax_calib.c").read_bytes()
    assert (tmp_path / "out" / "triax_calib.c").read_bytes() == made


@pytest.mark.long
def test_the_pages_that_messages_name_are_in_it(installed: Path, tmp_path: Path) -> None:
    folder = Path(triaxcal(installed, tmp_path, "doctor").stdout.splitlines()[0].split(": ")[1])
    package = folder.parent.parent
    texts = [p.read_text(encoding="utf-8") for p in package.rglob("*.py")]
    pages = {name for text in texts for name in re.findall(r"docs/([a-z/-]+\.md)", text)}
    assert len(pages) > 10
    pages |= {p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")}
    pages = {page for page in pages if not page.startswith("_build/")}
    assert [page for page in sorted(pages) if not (folder / page).is_file()] == []


def test_examples(tmp_path: Path) -> None:
    with pytest.raises(api.RefusedError, match="`triaxcal example AT-SIM` copies the example"):
        api.read_unit(tmp_path / "no units" / "AT-SIM")
    assert [e.name for e in api.examples()] == ["AT-CHERNIAK", "AT-SIM", "AT-SIM-BENCH", "IMU-SIM"]
    with pytest.raises(api.UsageError, match=r'found \'at-sim\' \(did you mean "AT-SIM"\?\)'):
        api.copy_example("at-sim", tmp_path)
    (tmp_path / "AT-SIM").symlink_to(tmp_path / "nowhere")
    with pytest.raises(api.RefusedError, match="exists already"):
        api.copy_example("AT-SIM", tmp_path)
    imu = api.copy_example("IMU-SIM", tmp_path / "deep" / "units")
    assert sorted(p.name for p in imu.iterdir()) == ["imu_truth.toml", "unit.toml"]


def test_the_page_of_the_index_renders_alone(wheel: Path) -> None:
    metadata = email.message_from_bytes(
        zipfile.ZipFile(wheel).read(f"triaxcal-{api.__version__}.dist-info/METADATA")
    )
    page = metadata.get_payload()
    assert isinstance(page, str)
    assert page.strip() == (ROOT / "PACKAGE.md").read_text(encoding="utf-8").strip()
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert not re.search(r"\]\(|<img|<a |^\[.*\]:", page, re.MULTILINE)
    authors = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'name: "{metadata["Author"]}"' in authors
    named = [c.rpartition(":: ")[2] for c in metadata.get_all("Classifier", []) if ":: 3." in c]
    assert f">={named[0]}" == metadata["Requires-Python"]


def test_every_extra_says_what_it_is_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    developers = {"dev", "docs", "fuzz", "a2l", "bench", "readers", "recordings"}
    assert set(EXTRAS) == set(project["optional-dependencies"]) - developers


@pytest.mark.long
def test_two_builds_are_equal_to_the_byte(wheel: Path, tmp_path: Path) -> None:
    """In other folders, with other times and permissions of the files; and from the sdist."""
    made = []
    for name, time_s, mode in (
        ("a", 1_600_000_000, 0o644),
        ("a longer name", 1_700_000_000, 0o600),
    ):
        copy = tmp_path / name
        paths = [ROOT / p for p in FOLDERS]
        skipped = shutil.ignore_patterns("__pycache__", "_build", "sessions", "recording.csv")
        for path in paths if name == "a" else paths[::-1]:
            shutil.copytree(path, copy / path.name, ignore=skipped)
        for path in (p for p in ROOT.iterdir() if p.is_file()):
            shutil.copy(path, copy / path.name)
        for path in (p for p in copy.rglob("*") if p.is_file()):
            os.utime(path, (time_s, time_s))
            path.chmod(mode | path.stat().st_mode & 0o100)
        out = tmp_path / f"{name}-out"
        command = [sys.executable, "-m", "hatchling", "build", "-d", str(out)]
        subprocess.run(command, cwd=copy, check=True, capture_output=True)
        made.append({p.name: p.read_bytes() for p in out.iterdir()})
    assert len(made[0]) == 2
    assert made[0] == made[1]
    assert made[0][wheel.name] == wheel.read_bytes()
    (sdist,) = (tmp_path / "a-out").glob("*.tar.gz")
    with tarfile.open(sdist) as opened:
        opened.extractall(tmp_path / "unpacked", filter="data")
    (source,) = (tmp_path / "unpacked").iterdir()
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    assert (tmp_path / wheel.name).read_bytes() == wheel.read_bytes()
    assert (source / "tests" / "conftest.py").is_file()
