"""What SIGKILL costs: raw frames lost, and how soon `rig resume` takes frames again.

    python bench/rig_kill.py [kills]

The times are this machine's; a busy one lets the receiver wait, and that is in them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "rig"))

from kill_campaign import raw_frames_killed
from rig_cases import BENCH, play, rig_of, short_setup

from triaxcal.rig.logs.candump import format_frames
from triaxcal.rig.records.recording import LOG_FILE, Recording

KILLS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
LOG_BYTES = 1 << 30
ENTRY = "from triaxcal.cli.entry import entry; entry()"


def raw_frames(top: Path) -> None:
    found = [raw_frames_killed(top, seed) for seed in range(KILLS)]
    lost = np.array([row["lost_ms"] for row in found])
    print(
        f"{KILLS} kills at 211 frames/s: raw frames lost, median {np.median(lost):.0f} ms, "
        f"95 % {np.quantile(lost, 0.95):.0f} ms, most {lost.max():.0f} ms; "
        f"over 100 ms: {int((lost > 100).sum())}; load {os.getloadavg()[0]:.1f}"
    )


def resume(top: Path) -> None:
    """From the command to its first word, on a session whose log has a gigabyte."""
    setup = short_setup(top)
    rig = rig_of(setup)
    folder = top / "sessions" / "001"
    folder.mkdir(parents=True)
    text = format_frames(rig.advance(), "virtual")
    with (folder / LOG_FILE).open("wb") as file:
        for _ in range(LOG_BYTES // (1024 * len(text))):
            file.write(text * 1024)
    taken = Recording(setup, folder, "virtual")
    play(rig, taken.feed, taken.engine.session, accepted=1)
    taken.close()
    unit = top / "AT-SIM-BENCH"
    shutil.copytree(BENCH, unit, ignore=lambda _, names: [n for n in names if "." not in n])
    size = (folder / LOG_FILE).stat().st_size
    command = [sys.executable, "-c", ENTRY, "rig"]
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
    print(
        f"log of {size / 1e9:.1f} GB: {said}; from the command on {resume_s:.1f} s, "
        f"{resume_s / status_s:.1f} times what `rig status` of no session takes"
    )


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        raw_frames(Path(folder))
        resume(Path(folder))


main()
