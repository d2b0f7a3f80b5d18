"""Whatever ends an unattended run: the chamber gets its safe temperature, the table goes home."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rig_cases import BENCH, SHORT_PLAN

pytestmark = pytest.mark.long

SET = """
import pathlib, sys, time
state = pathlib.Path(sys.argv[1])
if (state.parent / "dead").exists() and "{name}" in (state.parent / "dead").read_text():
    sys.exit("no voltage")
state.write_text(sys.argv[2])
with state.with_suffix(".all").open("a") as log:
    log.write(sys.argv[2] + "\\n")
"""


def started(folder: Path, *more: str, position: str = "{position}") -> subprocess.Popen[str]:
    """`rig run --unattended` on the virtual bus, with two programs for chamber and table.

    The rig itself does not follow them: it stays at 20 degC in TP1, where nothing is wrong until
    the bench waits for -40 degC.
    """
    for name in ("chamber", "table"):
        (folder / f"{name}.py").write_text(SET.replace("{name}", name))

    def command(name: str, word: str) -> list[str]:
        return [sys.executable, str(folder / f"{name}.py"), str(folder / name), word]

    plan = SHORT_PLAN.format(rate=100, layout="classic", temps="[-40, 20]", take="false")
    (folder / "plan.toml").write_text(
        f"""{plan}
[chamber]
driver = "command"
command = {command("chamber", "{degc:g}")}
timeout_s = 60
settle_max_s = 40000
[positioner]
driver = "command"
command = {command("table", position)}
home = "TP6"
timeout_s = 60
[unattended]
attempts = 2
""",
        encoding="utf-8",
    )
    return subprocess.Popen(
        [
            sys.executable, "-m", "triaxcal", "rig", "run", "--bus", "virtual", "--plain",
            "--unattended", "--unit", str(BENCH), "--plan", str(folder / "plan.toml"),
            "--sessions", str(folder / "sessions"), *more,
        ],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip


def wait_for(path: Path, text: str, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 120
    while not (path.exists() and path.read_text() == text):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.05)


SAFE = ["chamber: set to the safe 23 degC", "positioner: sent home to TP6"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal(tmp_path, number):
    process = started(tmp_path)
    wait_for(tmp_path / "chamber", "-40", process)
    wait_for(tmp_path / "table", "TP1", process)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert (tmp_path / "chamber").read_text() == "23"
    assert (tmp_path / "table").read_text() == "TP6"
    lines = errors.splitlines()
    assert lines[-2:] == SAFE
    assert lines[-3].startswith("stopped; go on with: triaxcal rig resume")


def test_a_lost_instrument(tmp_path):
    """The table loses its voltage: the run stops with that reason, the chamber is set."""
    process = started(tmp_path)
    (tmp_path / "dead").write_text("table")
    wait_for(tmp_path / "chamber", "-40", process)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert (tmp_path / "chamber").read_text() == "23"
    refusal = f"positioner: {sys.executable}: ended with exit code 1: no voltage (tried 2 times)"
    lines = errors.splitlines()
    assert lines[0] == SAFE[0]
    assert lines[1].startswith("positioner: NOT sent home to TP6, do it by hand: ")
    assert lines[2] == f"triaxcal: {refusal}"
    assert len(lines) == 3


def test_an_error_of_the_program(tmp_path):
    """Another unit answers: what is raised deep in the loop passes by the last orders."""
    process = started(tmp_path, "--fault", "serial@400")
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert (tmp_path / "chamber").read_text() == "23"
    assert (tmp_path / "table").read_text() == "TP6"
    lines = errors.splitlines()
    assert lines[:2] == SAFE
    assert "serial number" in lines[2]


def test_a_process_that_is_refused_gives_no_order(tmp_path):
    """The chamber is that of the first process, which goes on."""
    with started(tmp_path) as first:
        try:
            wait_for(tmp_path / "chamber", "-40", first)
            command = [str(word).replace("run", "resume") if word == "run" else word
                       for word in first.args]  # fmt: skip
            second = subprocess.run(command, capture_output=True, text=True, check=False)
            assert second.returncode == 1
            assert f"a session is under way in process {first.pid}, " in second.stderr
            assert "safe" not in second.stderr
            assert (tmp_path / "chamber.all").read_text() == "-40\n"
        finally:
            first.kill()
