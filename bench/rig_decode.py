"""Reading a log: our decoder by columns against cantools, ratios within one run.

python bench/rig_decode.py [frames]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import can
import numpy as np

from triaxcal.rig.candump import format_frames, parse
from triaxcal.rig.dbc import default_dbc, load_database, read_dbc
from triaxcal.rig.frames import concatenate
from triaxcal.rig.samples import SampleDecoder
from triaxcal.rig.simframes import FrameMaker

FRAMES = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
PEER = 50_000
CHUNK = 4 << 20


def make_log(path: Path) -> None:
    maker = FrameMaker(read_dbc(default_dbc()), "classic", 100, 1, 1_700_000_000 * 10**9)
    rng = np.random.default_rng(1)
    with path.open("wb") as file:
        count = second = 0
        while count < FRAMES:
            parts = []
            for _ in range(100):
                codes = rng.integers(-(2**23), 2**23, (100, 3))
                parts.append(maker.frames(codes, rng.integers(-5000, 9000, 10), second, 1))
                second += 1
            frames = concatenate(parts)
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


def timed(function) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    count = function()
    return (time.perf_counter() - wall) / count, (time.process_time() - cpu) / count


def ours(path: Path) -> int:
    decoder = SampleDecoder(read_dbc(default_dbc()), "classic", 100)
    count = 0
    with ThreadPoolExecutor(2) as pool:
        for parsed in pool.map(parse, chunks(path)):
            decoder.feed(parsed.frames)
            count += parsed.lines
    return count


def python_can_and_cantools(path: Path) -> int:
    database, count = load_database(default_dbc()), 0
    with can.CanutilsLogReader(str(path)) as reader:
        for message in reader:
            database.decode_message(message.arbitration_id, message.data)
            count += 1
            if count == PEER:
                break
    return count


def decode_message_only(path: Path) -> int:
    database, count = load_database(default_dbc()), 0
    with can.CanutilsLogReader(str(path)) as reader:
        messages = [m for _, m in zip(range(PEER), reader, strict=False)]
    start = time.perf_counter()
    for message in messages:
        database.decode_message(message.arbitration_id, message.data)
        count += 1
    return time.perf_counter() - start, count


def command_line(path: Path) -> int:
    with path.open("rb") as file:
        text = b"".join(line for _, line in zip(range(PEER), file, strict=False))
    command = [str(Path(sys.executable).parent / "cantools"), "decode", str(default_dbc())]
    subprocess.run(command, input=text, capture_output=True, check=True)
    return text.count(b"\n")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.log"
        make_log(path)
        wall, cpu = timed(lambda: ours(path))
        print(
            f"ours, parse + CRC + samples   {1e-3 / wall:7.0f} kframes/s, "
            f"{1e6 * wall:.2f} s for 1e6, CPU {1e6 * cpu:.2f} us a frame"
        )
        seconds, count = decode_message_only(path)
        print(
            f"cantools decode_message only  {1e-3 * count / seconds:7.0f} kframes/s, "
            f"ratio {seconds / count / wall:.1f}"
        )
        peer, _ = timed(lambda: python_can_and_cantools(path))
        print(
            f"python-can reader + cantools  {1e-3 / peer:7.0f} kframes/s, ratio {peer / wall:.1f}"
        )
        peer, _ = timed(lambda: command_line(path))
        print(
            f"cantools decode               {1e-3 / peer:7.0f} kframes/s, ratio {peer / wall:.1f}"
        )


main()
