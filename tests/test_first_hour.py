"""Code of the tutorials, of two how-to pages and of the README runs and prints what they show."""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parent.parent
CHECKER = doctest.OutputChecker()

Block = tuple[str, str, str]
"""Text before a block, its language, its content."""


def blocks(page: str) -> list[Block]:
    """All fenced blocks of a page, in order."""
    text = (REPO / page).read_text(encoding="utf-8")
    parts = re.split(r"^```(\w*)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    return list(zip(parts[0::3], parts[1::3], parts[2::3], strict=False))


def assert_prints(what: str, expected: str, found: str) -> None:
    """Equal, but for `...`, which stands for anything, and for how lines are wrapped."""
    alike = CHECKER.check_output(expected, found, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert alike, f"{what}\nshown in the page:\n{expected}\nprinted:\n{found}"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of what the tutorials use; commands and scripts run in it."""
    shutil.copytree(REPO / "units", tmp_path / "units", ignore=shutil.ignore_patterns("sessions"))
    shutil.copy(REPO / "Makefile", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(
        "PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    )
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    return tmp_path


def run(command: str, expected: str) -> None:
    done = subprocess.run(
        ["bash", "-c", command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
        text=True,
    )
    if expected:
        assert_prints(command, expected, done.stdout)
    else:
        assert done.returncode == 0, f"{command}\n{done.stdout}"


def test_the_hour_at_the_command_line(home: Path) -> None:
    for before, language, content in blocks("docs/first-hour/command-line.md"):
        if language == "c":
            name = re.findall(r"`(\w+\.c)`", before)[-1]
            (home / name).write_text(content, encoding="utf-8")
        if language == "console":
            for step in content.split("$ ")[1:]:
                command, _, expected = step.partition("\n")
                run(command, expected)


@pytest.mark.usefixtures("home")
def test_the_readme_shows_what_its_first_command_prints() -> None:
    (summary,) = (content for _, language, content in blocks("README.md") if language == "text")
    run("triaxcal calib units/AT-SIM", summary)


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize(
    "page",
    ["docs/first-hour/python.md", "docs/how-to/python.md", "docs/how-to/extend.md", "README.md"],
)
def test_the_python_of_a_page_runs_and_prints_what_it_shows(page: str) -> None:
    names: dict[str, object] = {"__name__": "__main__"}
    printed = None
    for _, language, content in blocks(page):
        if language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(content, page, "exec"), names)
            printed = out.getvalue()
        elif language == "text" and printed is not None:
            assert_prints(page, content, printed)
            printed = None
