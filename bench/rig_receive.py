"""CPU time a frame of the live path: our receiver and pipeline against python-can and cantools.

A socket pair stands for the device where there is no SocketCAN; the system calls are the same.

    python bench/rig_receive.py [seconds of the rig at 1 kHz]
"""

from __future__ import annotations

import socket
import sys
import tempfile
import time
from pathlib import Path

import can

from triaxcal.rig.dbc import default_dbc, load_database, read_dbc
from triaxcal.rig.engine import Setup
from triaxcal.rig.plan import read_plan
from triaxcal.rig.recording import Recording
from triaxcal.rig.samples import SampleDecoder
from triaxcal.rig.simulator import RigSettings, SimulatedRig
from triaxcal.rig.socketcan import SocketSource, packed
from triaxcal.rig.sources import messages_of
from triaxcal.simulation.truth import read_truth
from triaxcal.unitfile import read_unit

SECONDS = int(sys.argv[1]) if len(sys.argv) > 1 else 20
REPO = Path(__file__).parents[1]
BUSY = 9000  # frames a second of a full bus at 1 Mbit/s


def setup(folder: Path) -> Setup:
    bench = REPO / "units" / "AT-SIM-BENCH"
    unit = read_unit(bench)
    plan = folder / "plan.toml"
    text = (REPO / "rig" / "plans" / "five-temperatures.toml").read_text(encoding="utf-8")
    plan.write_text(text.replace("rate_hz = 100", "rate_hz = 1000"), encoding="utf-8")
    return Setup(bench, unit, read_plan(plan, unit), read_dbc(default_dbc()))


def ours(seconds, feed) -> float:
    """CPU seconds a frame; frames come in bursts of 50 ms, as the loop reads them."""
    ours_end, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
    source = SocketSource("bench0", lambda: ours_end)
    spent = count = 0
    for second in seconds:
        frames = packed(second)
        for start in range(0, len(frames), 100):
            burst = frames[start : start + 100]
            for frame in burst:
                theirs.send(frame)
            before = time.process_time()
            left = len(burst)
            while left:
                got = source.read()
                left -= len(got)
                feed(got)
            spent += time.process_time() - before
            count += len(burst)
    source.close()
    return spent / count


def theirs(seconds) -> float:
    """The same frames over python-can's virtual bus and cantools' decode_message."""
    database = load_database(default_dbc())
    sender = can.Bus(interface="virtual", channel="bench")
    receiver = can.Bus(interface="virtual", channel="bench")
    spent = count = 0
    for second in seconds:
        messages = messages_of(second)
        for message in messages:
            sender.send(message)
        before = time.thread_time()
        for _ in messages:
            message = receiver.recv(1.0)
            database.decode_message(message.arbitration_id, message.data)
        spent += time.thread_time() - before
        count += len(messages)
    sender.shutdown()
    receiver.shutdown()
    return spent / count


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        about = setup(folder)
        truth, _ = read_truth(about.folder)
        rig = SimulatedRig(about.unit, truth, about.plan, about.dbc, RigSettings())
        seconds = [rig.advance() for _ in range(SECONDS)]
        taken = Recording(about, folder / "001", "bench0")

        def whole(frames):
            taken.feed(frames)
            taken.log.flush()

        mine, peer = ours(seconds, whole), theirs(seconds)
        taken.close()
        alike = ours(seconds, SampleDecoder(about.dbc, "classic", 1000).feed)
    print(
        f"receive, log, CRC, decode, decide         {1e6 * mine:5.1f} us a frame, "
        f"{100 * mine * BUSY:.0f} % of a core at {BUSY} frames/s"
    )
    print(f"receive, CRC, decode                      {1e6 * alike:5.1f} us a frame")
    print(
        f"python-can virtual recv + cantools decode {1e6 * peer:5.1f} us a frame, no system "
        f"call, CRC or log in it; ratio to the line above {peer / alike:.1f}"
    )


main()
