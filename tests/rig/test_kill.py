"""SIGKILL at any moment, and a disk that is full: what was acknowledged is there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from kill_campaign import accepted_lines, raw_frames_killed
from rig_cases import short_setup
from test_cli_rig import bench_copy, triaxcal

from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE, LOG_FILE, durable_events
from triaxcal.rig.records.replay import replay

HERE = Path(__file__).parent


def campaign(folder, first, count):
    command = [sys.executable, str(HERE / "kill_campaign.py"), str(folder), str(first), str(count)]
    paths = os.pathsep.join([str(HERE), str(HERE.parent)])
    environment = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr[-3000:]
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["seed"] for row in found] == list(range(first, first + count))
    return found


def test_the_log_of_a_killed_session_is_what_came(tmp_path):
    raw_frames_killed(tmp_path, 1)


@pytest.mark.slow
def test_two_hundred_kills(tmp_path):
    """Every check is in the campaign; bench/entries/rig_kill.py measures what a kill costs."""
    found = campaign(tmp_path, 0, 200)
    # Kills hit every part of a session, and the frames on their way.
    assert {row["shown"] for row in found} >= set(range(6))
    assert any(row["kept"] > row["shown"] for row in found)


@pytest.fixture
def small_disk(tmp_path, request):
    """A file system of some KiB, and the command that gives it room."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={request.param}k", "tmpfs", disk],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if made.returncode:
        pytest.skip(f"a small disk needs root: {made.stderr.strip()}")
    yield disk, ["mount", "-o", "remount,size=16m", str(disk)]
    subprocess.run(["umount", disk], check=True)


# A log grows by 9.5 kB/s: full while the noise is learned, or after the first dwells.
@pytest.mark.parametrize(
    "small_disk", [96, pytest.param(1024, marks=pytest.mark.slow)], indirect=True
)
def test_a_disk_that_fills_up_ends_the_session_and_it_goes_on_with_room(tmp_path, small_disk):
    disk, more_room = small_disk
    unit, setup = bench_copy(tmp_path), short_setup(tmp_path, temps="[20]")
    common = ("--bus", "virtual", "--plain", "--unit", unit, "--plan", setup.plan.source,
              "--sessions", disk)  # fmt: skip
    done = triaxcal("rig", "run", *common)
    assert done.returncode == 1
    assert done.stderr == (
        f"triaxcal: {disk}/001/frames.log: cannot be written: no space left on device; what was "
        "acknowledged is safe; free some space, then `triaxcal rig resume`\n"
    )
    assert not (unit / "measurements.csv").exists()
    shown = accepted_lines(done.stdout.splitlines())
    assert bool(shown) == (shutil.disk_usage(disk).total > 10**6)
    assert (disk / "001" / LOG_FILE).read_bytes().endswith(b"\n")
    found = read_journal(disk / "001" / JOURNAL_FILE)
    assert not found.torn
    kept = [event.text for event in durable_events(found.records) if event.dwell]
    assert kept == shown
    if not shown:
        return
    played = replay(setup, disk / "001" / LOG_FILE, disk / "001" / JOURNAL_FILE)
    assert len(played.engine.session.accepted) == len(kept)
    subprocess.run(more_room, check=True)
    again = triaxcal("rig", "resume", *common)
    assert again.returncode == 0, again.stderr
    assert f"s, {len(kept)} accepted dwells kept" in again.stdout
    assert len((unit / "measurements.csv").read_text().splitlines()) == 9
