"""Reading a log of a CAN bus: our decoder by columns beside python-can, cantools and asammdf."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path

import can
from measuring import Bench, Figure, cpu_s, pick, spent

from entries._at_sim_bench import setup_at
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.dbc import default_dbc
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.logs.candump import format_frames, parse
from triaxcal.rig.logs.export import export_log
from triaxcal.rig.records.replay import replay
from triaxcal.rig.samples.samples import SampleDecoder
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import read_truth

RATE = 1000
CHUNK = 4 << 20


def make_log(path: Path, setup: Setup, frames_wanted: int) -> None:
    """A rig at 1 kHz, at rest in its first position."""
    truth, _ = read_truth(setup.folder)
    rig = SimulatedRig(setup.unit, truth, setup.plan, setup.rig, RigSettings())
    count = 0
    with path.open("wb") as file:
        while count < frames_wanted:
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


def python_can_and_cantools(path: Path, most: int) -> int:
    database, count = read_bus_file(default_dbc()).database, 0
    with can.CanutilsLogReader(str(path)) as reader:
        for message in reader:
            database.decode_message(message.arbitration_id, message.data)
            count += 1
            if count == most:
                break
    return count


def decode_message_only(path: Path, most: int) -> float:
    """Seconds a frame."""
    database = read_bus_file(default_dbc()).database
    with can.CanutilsLogReader(str(path)) as reader:
        messages = [m for _, m in zip(range(most), reader, strict=False)]
    start = cpu_s()
    for message in messages:
        database.decode_message(message.arbitration_id, message.data)
    return (cpu_s() - start) / len(messages)


def command_line(path: Path, most: int) -> int:
    with path.open("rb") as file:
        text = b"".join(line for _, line in zip(range(most), file, strict=False))
    command = [str(Path(sys.executable).parent / "cantools"), "decode", str(default_dbc())]
    subprocess.run(command, input=text, capture_output=True, check=True)
    return text.count(b"\n")


def with_asammdf(path: Path) -> float:
    """Seconds a frame for the bus logging of an MF4 with the same frames: by its own C code."""
    from asammdf import MDF  # noqa: PLC0415

    frames = int(path.with_suffix(".count").read_text())

    def extract() -> None:
        with MDF(path) as log:
            log.extract_bus_logging({"CAN": [(str(default_dbc()), 0)]}).close()

    return spent(extract) / frames


def measure(size: str) -> list[Figure]:
    frames = pick(size, 20_000, 300_000, 1_000_000)
    most = pick(size, 2_000, 20_000, 50_000)
    with tempfile.TemporaryDirectory() as folder:
        path, setup = Path(folder) / "frames.log", setup_at(RATE, Path(folder))
        make_log(path, setup, frames)
        mine = _a_frame(lambda: ours(path))
        whole = _a_frame(lambda: replayed(setup, path))
        peers = {
            "cantools `decode_message` of messages in memory": decode_message_only(path, most),
            _READER: _a_frame(lambda: python_can_and_cantools(path, most)),
            "`cantools decode`": _a_frame(lambda: command_line(path, most)),
        }
        if find_spec("asammdf"):
            mf4 = path.with_suffix(".mf4")
            count, _ = export_log(path, mf4, lambda _: None)
            mf4.with_suffix(".count").write_text(f"{count}")
            peers["asammdf `extract_bus_logging` of the same frames in MF4"] = with_asammdf(mf4)
    found = [Figure(_READ, 1e6 * mine, "µs a frame", name, 1e6 * s) for name, s in peers.items()]
    return [*found, Figure(_REPLAY, 1e6 * whole, "µs a frame", _READER, 1e6 * peers[_READER])]


def _a_frame(function: Callable[[], int]) -> float:
    start = cpu_s()
    count = function()
    return (cpu_s() - start) / count


_READER = "python-can reader and cantools"
_READ = "text of candump to samples, with CRC and counters"
_REPLAY = "`triaxcal rig replay`: the same, and every decision of a session"
ENTRY = Bench(
    name="rig_decode",
    label="Reading a log of a CAN bus",
    doc="A log of candump from the simulated rig at 1 kHz. The peers decode frames and do nothing "
    "else: no CRC, no counter, no decision.",
    measure=measure,
    figures=(_READ, _REPLAY),
    packages=("can", "cantools"),
    sizes="300 000 frames, a million with --full",
    rank=50,
)
