"""Runs the node on any bus of python-can, for machines without SocketCAN. Ctrl-C ends it.

    python on_bus.py udp_multicast:239.74.163.2 ./xcp_node flash.bin samples.bin

The node gets a socket in place of a CAN device; this carries the frames between both.
"""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import subprocess
import sys
from collections.abc import Callable

import can

REQUEST_ID, RESPONSE_ID = 0x650, 0x651
FRAME = struct.Struct("=IB3x8s")  # struct can_frame


def carry(bus: can.BusABC, node: socket.socket, goes_on: Callable[[], bool]) -> None:
    """Carry frames until the node ends, or `goes_on` says no."""
    while goes_on():
        message = bus.recv(0.001)
        if message is not None and message.arbitration_id == REQUEST_ID:
            data = bytes(message.data)
            node.send(FRAME.pack(REQUEST_ID, len(data), data.ljust(8, b"\0")))
        while select.select([node], [], [], 0.0)[0]:
            answer = node.recv(FRAME.size)
            if not answer:
                return
            _, size, data = FRAME.unpack(answer)
            data = data[:size]
            bus.send(can.Message(arbitration_id=RESPONSE_ID, data=data, is_extended_id=False))


def run(name: str, program: str, *files: str, goes_on: Callable[[], bool] = lambda: True) -> int:
    """Start the node on the bus `interface:channel`; its exit code."""
    interface, _, channel = name.partition(":")
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with can.Bus(interface=interface, channel=channel) as bus, ours:
        command = [program, "socket", str(theirs.fileno()), *files]
        node = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        theirs.close()
        # A broken pipe is a node that has ended, as one whose power fails.
        with contextlib.suppress(KeyboardInterrupt, BrokenPipeError, ConnectionResetError):
            carry(bus, ours, goes_on)
        ours.close()
        return node.wait()


if __name__ == "__main__":
    sys.exit(run(*sys.argv[1:]))
