"""CPU time a frame of the live path: our receiver and pipeline against python-can and cantools.

A socket pair stands for the device where there is no SocketCAN; the system calls are the same.
"""

from __future__ import annotations

import select
import socket
import tempfile
import time
from pathlib import Path

from can.interfaces.socketcan.socketcan import capture_message
from measuring import Bench, Figure, pick

from entries._at_sim_bench import setup_at
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.dbc import default_dbc
from triaxcal.rig.records.recording import Recording
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.rig.sources.socketcan import SocketSource, packed
from triaxcal.rig.sources.source import PACE_S
from triaxcal.simulation.truth import read_truth

RATE = 4000
BUSY = 9000  # frames a second of a full bus at 1 Mbit/s
BURST = round(BUSY * PACE_S)  # what one read of the receiver finds there


def spent(seconds, receive) -> float:
    """CPU seconds a frame; frames come in bursts of 20 ms, as the loop reads them.

    `receive` gets a socket once, and gives a function that takes what waits and counts it.
    """
    ours_end, theirs_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs_end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
    take = receive(ours_end)
    cpu = count = 0
    for second in seconds:
        frames = packed(second)
        for start in range(0, len(frames), BURST):
            burst = frames[start : start + BURST]
            for frame in burst:
                theirs_end.send(frame)
            before = time.process_time()
            left = len(burst)
            while left:
                left -= take()
            cpu += time.process_time() - before
            count += len(burst)
    ours_end.close()
    theirs_end.close()
    return cpu / count


def ours(feed):
    def receive(link):
        source = SocketSource("bench0", lambda: link)

        def take():
            frames = source.read()
            feed(frames)
            return len(frames)

        return take

    return receive


def python_can_and_cantools(link):
    """What python-can's socketcan bus does for a frame, on this socket, and cantools' decoding."""
    database = read_bus_file(default_dbc()).database
    link.setsockopt(socket.SOL_SOCKET, 35, 1)  # SO_TIMESTAMPNS

    def take():
        select.select([link], [], [], 1.0)
        message = capture_message(link)
        database.decode_message(message.arbitration_id, message.data)
        return 1

    return take


def measure(size: str) -> list[Figure]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        about = setup_at(RATE, folder)
        truth, _ = read_truth(about.folder)
        rig = SimulatedRig(about.unit, truth, about.plan, about.rig, RigSettings())
        seconds = [rig.advance() for _ in range(pick(size, 1, 3, 8))]
        taken = Recording(about, folder / "001", "bench0")

        def whole(frames):
            taken.feed(frames)
            taken.log.flush()

        mine = spent(seconds, ours(whole))
        taken.close()
        receive = spent(seconds, ours(lambda _: None))
        peer = spent(seconds, python_can_and_cantools)
    busy = f"{BUSY} frames a second"
    return [
        Figure(_LIVE, 1e6 * mine, "µs a frame", _PEER, 1e6 * peer),
        Figure(_ALONE, 1e6 * receive, "µs a frame", _PEER, 1e6 * peer),
        Figure(f"share of a core at {busy}, a full bus of 1 Mbit/s", 100 * mine * BUSY, "%",
               f"python-can and cantools at {busy}", 100 * peer * BUSY),
    ]  # fmt: skip


_LIVE = "receive, log, CRC, decode, decide"
_ALONE = "receive alone"
_PEER = "python-can `recv` and cantools, without log, CRC or decision"
ENTRY = Bench(
    name="rig_receive",
    label="Receiving from a CAN bus",
    doc="The live path of the bench at 8011 frames a second, in bursts as the loop reads them. A "
    "socket pair stands for the device; the system calls are the same.",
    measure=measure,
    figures=(_LIVE, _ALONE),
    packages=("can", "cantools"),
    sizes="3 s of the rig, 8 s with --full",
    rank=51,
)
