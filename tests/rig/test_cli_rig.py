"""`triaxcal rig` as a user meets it: one line for a mistake, exit codes, files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import can
import numpy as np
import pytest
from rig_cases import BENCH, REPO, rig_of, short_setup

from triaxcal.rig.logs.candump import format_frames, read_log
from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE, LOG_FILE, durable_events
from triaxcal.rig.records.replay import replay
from triaxcal.rig.simulated.simulator import EPOCH_NS


def triaxcal(*arguments, cwd=REPO):
    program = "from triaxcal.cli.entry import entry; entry()"
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True, text=True, check=False, cwd=cwd,
    )  # fmt: skip


def bench_copy(folder):
    """A unit of its own, so that records of tests do not land in the shipped one."""
    unit = folder / "AT-SIM-BENCH"
    unit.mkdir()
    for name in ("unit.toml", "truth.toml"):
        (unit / name).write_bytes((BENCH / name).read_bytes())
    return unit


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("run", "--bus", "virtual", "--unit", "NOPE"), 1, "no such unit"),
        (("run", "--bus", "pcann:1", "--unit", "AT-SIM-BENCH"), 2, 'did you mean "pcan"'),
        (("check", "--bus", "can99", "--unit", "AT-SIM-BENCH"), 1, "can99: "),
        (("run", "--bus", "virtual", "--unit", "AT-SIM-BENCH", "--fault", "x"), 2, "--fault"),
        (("run", "--bus", "can0", "--unit", "AT-SIM-BENCH", "--fault", "slip@3"), 1, "virtual"),
        (("replay", "--unit", "AT-SIM-BENCH", "nothing.log"), 1, "nothing.log: cannot be read"),
        (
            ("export", "nothing.log", "x.xyz"),
            1,
            "expected one of .asc, .blf, .csv, .log, .mf4, .parquet",
        ),
        (
            ("run", "--bus", "virtual", "--unit", "AT-CHERNIAK"),
            1,
            "AT-CHERNIAK has no truth.toml; expected a simulated unit",
        ),
        (("resume", "--bus", "virtual", "--unit", "AT-CHERNIAK"), 1, "no session in it"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments, code, said):
    done = triaxcal("rig", *arguments)
    assert done.returncode == code
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("fault", "wrong"),
    [
        (None, None),
        ("lose@2:5", "2 lost"),
        ("bitflip@2:3", "3 frames with a wrong CRC"),
        ("error@2:4", "4 error frames"),
        ("serial@0", 'expected "AT-SIM-BENCH-001"'),
        ("twonodes@1:1:9", "frames without their partner"),
        ("clipped@0:1:99", "noise x 0"),
    ],
)
def test_check(fault, wrong):
    orders = ("--fault", fault) if fault else ()
    done = triaxcal("rig", "check", "--bus", "virtual", "--unit", "AT-SIM-BENCH", *orders)
    assert done.returncode == (1 if fault else 0), done.stdout
    bad = [line for line in done.stdout.splitlines() if line.startswith("WRONG")]
    assert bool(bad) == bool(fault)
    assert wrong is None or wrong in "\n".join(bad)


def test_a_session_is_run_replayed_shown_and_exported(tmp_path):
    unit = bench_copy(tmp_path)
    setup = short_setup(tmp_path, temps="[20]")
    common = ("--unit", unit, "--plan", setup.plan.source)
    done = triaxcal("rig", "run", "--bus", "virtual", "--plain", *common)
    assert done.returncode == 0, done.stderr
    assert "accepted: TP6 (+X up) at 20" in done.stdout
    session = unit / "sessions" / "001"
    again = triaxcal("rig", "replay", *common, "--into", tmp_path, session / LOG_FILE)
    assert again.returncode == 0, again.stderr
    for name in ("measurements.csv", "measurements.json"):
        assert (tmp_path / name).read_bytes() == (unit / name).read_bytes()
    assert "001: 6 accepted dwells" in triaxcal("rig", "status", *common).stdout
    frames = sum(p.lines for p in read_log(session / LOG_FILE))
    target = tmp_path / "x.blf"
    assert f"{frames} frames" in triaxcal("rig", "export", session / LOG_FILE, target).stdout
    with can.BLFReader(str(target)) as reader:
        assert sum(1 for _ in reader) == frames


def _kill_somewhere(tmp_path, seed):
    """Kill a session at a random moment; the dwells that it had shown."""
    unit = bench_copy(tmp_path)
    setup = short_setup(tmp_path, temps="[20]")
    program = "from triaxcal.cli.entry import entry; entry()"
    command = [sys.executable, "-u", "-c", program, "rig", "run", "--bus", "virtual", "--plain",
               "--unit", str(unit), "--plan", setup.plan.source]  # fmt: skip
    rng = np.random.default_rng(seed)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        shown = []
        assert process.stdout is not None
        stop_after = int(rng.integers(1, 7))
        for line in process.stdout:
            shown.append(line)
            if len(shown) >= stop_after:
                break
        time.sleep(float(rng.uniform(0.0, 1.0)))
        os.kill(process.pid, signal.SIGKILL)
        shown += process.stdout.readlines()
    return unit, setup, [line for line in shown if " accepted: " in line]


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in range(1, 6))]
)
def test_sigkill_loses_no_acknowledged_dwell(tmp_path, seed):
    unit, setup, shown = _kill_somewhere(tmp_path, seed)
    session = unit / "sessions" / "001"
    kept = [e for e in durable_events(read_journal(session / JOURNAL_FILE).records) if e.dwell]
    assert [e.text for e in kept][: len(shown)] == [
        s.split(" accepted: ")[1].strip() for s in shown
    ]
    # The evidence holds each accepted dwell to its last frame.
    played = replay(setup, session / LOG_FILE, session / JOURNAL_FILE)
    accepted = {(d.step, d.position): d for d in (e.dwell for e in kept)}
    for key, dwell in accepted.items():
        assert played.engine.session.accepted[key] == dwell
    common = ("--unit", unit, "--plan", setup.plan.source, "--bus", "virtual", "--plain")
    if len(kept) < 6:
        done = triaxcal("rig", "resume", *common)
        assert done.returncode == 0, done.stderr
        assert len((unit / "measurements.csv").read_text().splitlines()) == 9


def test_a_log_of_the_simulated_rig_is_whole(tmp_path):
    frames = rig_of(short_setup(tmp_path)).advance()
    assert frames.t_ns[0] == EPOCH_NS
    assert format_frames(frames, "x").count(b"\n") == len(frames)


def test_a_session_that_recorded_nothing_hides_no_other(tmp_path):
    """As one that was killed before its journal was begun."""
    sessions = tmp_path / "sessions"
    (sessions / "001").mkdir(parents=True)
    done = triaxcal("rig", "status", "--unit", BENCH, "--sessions", sessions)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{sessions}/001: no journal, nothing was recorded\n"
