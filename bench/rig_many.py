"""CPU of a session of many units against real time: `python bench/rig_many.py [UNITS] [SECONDS]`.

Units at 100 samples a second on two buses, simulated first. What is measured is everything that a
session does with their frames, cut into the batches of the receiver: log, decoders, decisions,
journal, group; and what python-can's messages cost on top, which the bench's own receiver of
SocketCAN saves.
"""

from __future__ import annotations

import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "rig"))

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


def main(units: int, seconds: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        setup = setup_of(Path(name), units)
        made = simulated(bench_of(setup), seconds)
        taken = ManyRecording(setup, Path(name) / "001")
        start, wall, count = time.process_time(), time.perf_counter(), 0
        for number, batches in enumerate(made):
            for bus, frames in batches:
                told = taken.feed(bus, frames)
                taken.flush()
                taken.group.look(float(number), told)
                count += len(frames)
        session = time.process_time() - start
        wall = time.perf_counter() - wall
        start = time.process_time()
        for _ in range(4 * 20):
            many_screen(taken.group, "001", "12:00", "")
        screen = (time.process_time() - start) / 20
        messages = [messages_of(frames) for _, frames in made[-1]]
        start = time.process_time()
        for batch in messages:
            frames_of(batch)
        python_can = time.process_time() - start
        learned = sum(m.session.reference is not None for m in taken.group.members)
        dwells = sum(len(m.session.accepted) for m in taken.group.members)
        taken.close()
    print(f"{units} units, {count / seconds:.0f} frames/s for {seconds} s")
    print(f"{learned} have learned their noise, {dwells} dwells accepted")
    print(f"session     {session / seconds:.3f} of one core in real time ({wall:.1f} s of clock)")
    print(f"screen      {screen:.3f}, four times a second, without the terminal")
    print(f"python-can  {python_can:.3f}, making arrays of its messages")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:3]) if len(sys.argv) > 2 else (32, 120))
