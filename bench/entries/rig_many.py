"""CPU of a session of many units against real time.

What is measured is everything that a session does with their frames, cut into the batches of the
receiver: log, decoders, decisions, journal, group; and what python-can's messages cost on top,
which the bench's own receiver of SocketCAN saves.
"""

from __future__ import annotations

import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from measuring import TESTS, Bench, Figure, pick

sys.path.insert(0, str(TESTS / "rig"))

from many_cases import bench_of, setup_of

from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.bus.messages import frames_of, messages_of
from triaxcal.rig.many.recording import ManyRecording
from triaxcal.rig.many.screen import many_screen
from triaxcal.rig.many.simbench import SimulatedBench

_BATCHES = 40
"""A second: the receiver looks every 25 ms or so."""


def simulated(bench: SimulatedBench, seconds: int) -> list[list[tuple[str, Frames]]]:
    """Batches of each second, with their buses."""
    made = []
    for _ in range(seconds):
        batches = []
        for bus, lane in bench.lanes.items():
            frames = lane.advance()
            cuts = np.linspace(0, len(frames), _BATCHES + 1).astype(int).tolist()
            parts = [frames.take(slice(a, b)) for a, b in pairwise(cuts)]
            batches += [(i, bus, part) for i, part in enumerate(parts)]
        batches.sort(key=lambda batch: batch[0])
        made.append([(bus, frames) for _, bus, frames in batches])
    return made


def measure(size: str) -> list[Figure]:
    units, seconds = pick(size, (2, 3), (32, 20), (32, 120))
    with tempfile.TemporaryDirectory() as name:
        setup = setup_of(Path(name), units)
        made = simulated(bench_of(setup), seconds)
        taken = ManyRecording(setup, Path(name) / "001")
        start, count = time.process_time(), 0
        for number, batches in enumerate(made):
            for bus, frames in batches:
                told = taken.feed(bus, frames)
                taken.flush()
                taken.group.look(float(number), told)
                count += len(frames)
        session = time.process_time() - start
        start = time.process_time()
        for _ in range(4 * 20):
            many_screen(taken.group, "001", "12:00", "")
        screen = (time.process_time() - start) / 20
        messages = [messages_of(frames) for _, frames in made[-1]]
        start = time.process_time()
        for batch in messages:
            frames_of(batch)
        python_can = time.process_time() - start
        taken.close()
    per_s = 100.0 / seconds
    return [
        Figure(_SESSION, session * per_s, "%", "python-can making arrays of the same messages",
               100.0 * python_can),
        Figure(_SCREEN, 100.0 * screen, "%"),
        Figure(_FRAMES, count / seconds, "a second"),
    ]  # fmt: skip


_SESSION = "a session of 32 units, share of a core in real time"
_SCREEN = "its screen four times a second, share of a core"
_FRAMES = "frames of these units"
ENTRY = Bench(
    name="rig_many",
    label="A session of many units",
    doc="32 units at 100 samples a second on two buses: log, journal and every decision of each.",
    measure=measure,
    figures=(_SESSION, _SCREEN, _FRAMES),
    packages=("can", "cantools"),
    sizes="20 s of the session, 120 s with --full",
    rank=52,
)
