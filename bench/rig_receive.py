"""CPU time a frame of the live path: our receiver and pipeline against python-can and cantools.

A socket pair stands for the device where there is no SocketCAN; the system calls are the same.

    python bench/rig_receive.py [seconds of the rig at 4 kHz, 8011 frames/s]
"""

from __future__ import annotations

import select
import socket
import sys
import tempfile
import time
from pathlib import Path

from at_sim_bench import setup_at
from can.interfaces.socketcan.socketcan import capture_message

from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.dbc import default_dbc
from triaxcal.rig.records.recording import Recording
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.rig.sources.socketcan import SocketSource, packed
from triaxcal.rig.sources.source import PACE_S
from triaxcal.simulation.truth import read_truth

SECONDS = int(sys.argv[1]) if len(sys.argv) > 1 else 8
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


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        about = setup_at(RATE, folder)
        truth, _ = read_truth(about.folder)
        rig = SimulatedRig(about.unit, truth, about.plan, about.rig, RigSettings())
        seconds = [rig.advance() for _ in range(SECONDS)]
        taken = Recording(about, folder / "001", "bench0")

        def whole(frames):
            taken.feed(frames)
            taken.log.flush()

        mine = spent(seconds, ours(whole))
        taken.close()
        receive = spent(seconds, ours(lambda _: None))
        peer = spent(seconds, python_can_and_cantools)
    print(
        f"receive, log, CRC, decode, decide   {1e6 * mine:5.1f} us a frame, "
        f"{100 * mine * BUSY:.0f} % of a core at {BUSY} frames/s"
    )
    print(f"receive alone                       {1e6 * receive:5.1f} us a frame")
    print(
        f"python-can recv + cantools decode   {1e6 * peer:5.1f} us a frame, no log, CRC or "
        f"decision in it; ratio {peer / mine:.1f}"
    )


main()
