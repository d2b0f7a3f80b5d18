"""What SIGKILL costs: raw frames lost, and how soon `rig resume` takes frames again."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from measuring import TESTS, Bench, Figure, pick

sys.path.insert(0, str(TESTS / "rig"))

from kill_campaign import raw_frames_killed
from rig_cases import BENCH, play, rig_of, short_setup

from triaxcal.rig.logs.candump import format_frames
from triaxcal.rig.records.recording import LOG_FILE, Recording

START = "from triaxcal.cli.entry import entry; entry()"


def raw_frames(top: Path, kills: int) -> Figure:
    """Milliseconds of frames that a kill loses, the most of all kills."""
    lost = np.array([raw_frames_killed(top, seed)["lost_ms"] for seed in range(kills)])
    return Figure(_LOST, float(lost.max()), "ms", "the median kill", float(np.median(lost)))


def resume(top: Path, log_bytes: int) -> Figure:
    """From the command to its first word, on a session whose log has a gigabyte."""
    setup = short_setup(top)
    rig = rig_of(setup)
    folder = top / "sessions" / "001"
    folder.mkdir(parents=True)
    text = format_frames(rig.advance(), "virtual")
    with (folder / LOG_FILE).open("wb") as file:
        for _ in range(max(1, log_bytes // (1024 * len(text)))):
            file.write(text * 1024)
    taken = Recording(setup, folder, "virtual")
    play(rig, taken.feed, taken.engine.session, accepted=1)
    taken.close()
    unit = top / "AT-SIM-BENCH"
    shutil.copytree(BENCH, unit, ignore=lambda _, names: [n for n in names if "." not in n])
    size = (folder / LOG_FILE).stat().st_size
    command = [sys.executable, "-c", START, "rig"]
    common = ["--unit", str(unit), "--plan", setup.plan.source]
    sessions = ["--sessions", str(top / "sessions")]
    bus = ["--bus", "virtual", "--plain"]
    start = time.monotonic()
    subprocess.run([*command, "status", *common], check=True, capture_output=True)
    status_s = time.monotonic() - start
    start = time.monotonic()
    with subprocess.Popen(
        [*command, "resume", *common, *sessions, *bus], stdout=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        said = running.stdout.readline().strip()
        resume_s = time.monotonic() - start
        running.kill()
    assert said
    return Figure(f"{_RESUME} {size / 1e9:.1f} GB", resume_s, "s", "`rig status` of no session",
                  status_s)  # fmt: skip


def measure(size: str) -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder)
        found = [raw_frames(top, pick(size, 1, 5, 100))]
        return [*found, resume(top, pick(size, 1, 1 << 30, 1 << 30))]


_LOST = "frames lost by SIGKILL at 211 frames a second, the worst kill"
_RESUME = "from `rig resume` to its first word, by the clock, with a log of"
ENTRY = Bench(
    name="rig_kill",
    label="A session that is killed",
    doc="By the clock. A busy machine lets the receiver wait, and that is in the figures.",
    measure=measure,
    figures=(_LOST,),
    packages=("can", "cantools"),
    sizes="5 kills, 100 with --full",
    rank=53,
)
