"""Reading a log: our decoder by columns against cantools, ratios within one run.

python bench/rig_decode.py [frames]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import can
from at_sim_bench import setup_at

from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.dbc import default_dbc
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.logs.candump import format_frames, parse
from triaxcal.rig.records.replay import replay
from triaxcal.rig.samples.samples import SampleDecoder
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import read_truth

FRAMES = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
PEER = 50_000
RATE = 1000
CHUNK = 4 << 20


def make_log(path: Path, setup: Setup) -> None:
    """A rig at 1 kHz, at rest in its first position."""
    truth, _ = read_truth(setup.folder)
    rig = SimulatedRig(setup.unit, truth, setup.plan, setup.rig, RigSettings())
    count = 0
    with path.open("wb") as file:
        while count < FRAMES:
            frames = rig.advance()
            file.write(format_frames(frames, "can0"))
            count += len(frames)


def chunks(path: Path) -> list[bytes]:
    text, found = path.read_bytes(), []
    start = 0
    while start < len(text):
        end = text.rfind(b"\n", start, start + CHUNK) + 1
        found.append(text[start:end])
        start = end
    return found


def cpu_s() -> float:
    """CPU seconds so far, of ended children too."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def timed(function) -> tuple[float, float]:
    """Seconds a frame: on the clock, and of CPU."""
    wall, cpu = time.perf_counter(), cpu_s()
    count = function()
    return (time.perf_counter() - wall) / count, (cpu_s() - cpu) / count


def ours(path: Path) -> int:
    decoder = SampleDecoder(read_description(find_description("tilter")), RATE)
    count = 0
    with ThreadPoolExecutor(2) as pool:
        for parsed in pool.map(parse, chunks(path)):
            decoder.feed(parsed.frames)
            count += parsed.lines
    return count


def replayed(setup: Setup, path: Path) -> int:
    """`rig replay`: the same, and every decision of the session."""
    return int(replay(setup, path).log["lines"])


def python_can_and_cantools(path: Path) -> int:
    database, count = read_bus_file(default_dbc()).database, 0
    with can.CanutilsLogReader(str(path)) as reader:
        for message in reader:
            database.decode_message(message.arbitration_id, message.data)
            count += 1
            if count == PEER:
                break
    return count


def decode_message_only(path: Path) -> float:
    database, count = read_bus_file(default_dbc()).database, 0
    with can.CanutilsLogReader(str(path)) as reader:
        messages = [m for _, m in zip(range(PEER), reader, strict=False)]
    start = cpu_s()
    for message in messages:
        database.decode_message(message.arbitration_id, message.data)
        count += 1
    return (cpu_s() - start) / count


def command_line(path: Path) -> int:
    with path.open("rb") as file:
        text = b"".join(line for _, line in zip(range(PEER), file, strict=False))
    command = [str(Path(sys.executable).parent / "cantools"), "decode", str(default_dbc())]
    subprocess.run(command, input=text, capture_output=True, check=True)
    return text.count(b"\n")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path, setup = Path(folder) / "frames.log", setup_at(RATE, Path(folder))
        make_log(path, setup)
        mine = timed(lambda: ours(path))
        whole = timed(lambda: replayed(setup, path))
        for name, (wall, cpu) in (("parse, CRC, samples", mine), ("replay of a session", whole)):
            print(
                f"ours, {name}     {1e6 * wall:5.2f} s for 1e6 frames, "
                f"CPU {1e6 * cpu:5.2f} us a frame"
            )
        peers = {
            "cantools decode_message alone": decode_message_only(path),
            "python-can reader + cantools ": timed(lambda: python_can_and_cantools(path))[1],
            "cantools decode              ": timed(lambda: command_line(path))[1],
        }
        for name, cpu in peers.items():
            print(
                f"{name}                CPU {1e6 * cpu:6.2f} us a frame, {cpu / mine[1]:.1f} times "
                f"the first, {cpu / whole[1]:.1f} times the second"
            )
    print(f"the clock is that of a machine with load {os.getloadavg()[0]:.1f}")


main()
