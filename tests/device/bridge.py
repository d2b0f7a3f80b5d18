"""A node on python-can's virtual bus, behind a bridge that can lose, double and delay frames."""

from __future__ import annotations

import contextlib
import itertools
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from random import Random

import can

from device.node import _FRAME, REQUEST, RESPONSE, Node, frame
from triaxcal.device.link import Link
from triaxcal.rig.bus.openbus import open_bus

CHANNELS = itertools.count()
Fault = Callable[[int, bytes], list[bytes]]
"""Number and data of a frame, in either direction, to what the other side gets."""


def passed_on(_number: int, data: bytes) -> list[bytes]:
    return [data]


def losing(share: float, seed: int) -> Fault:
    rng = Random(seed)
    return lambda _number, data: [] if rng.random() < share else [data]


def doubling(share: float, seed: int) -> Fault:
    rng = Random(seed)
    return lambda _number, data: [data, data] if rng.random() < share else [data]


def both(share: float, seed: int) -> Fault:
    lose, double = losing(share, seed), doubling(share, seed + 1)
    return lambda number, data: double(number, data) if lose(number, data) else []


@dataclass
class Bridge:
    """Carries frames until it is stopped, or the node is gone."""

    bus: Callable[[], can.BusABC]
    node: socket.socket
    fault: Fault = passed_on
    frames: int = 0
    _stop: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        bus = self.bus()
        try:
            while not self._stop.is_set():
                self._from_bus(bus)
                if not self._from_node(bus):
                    return
        except OSError:
            pass  # the node is gone
        finally:
            bus.shutdown()

    def _from_bus(self, bus: can.BusABC) -> None:
        message = bus.recv(0.0005)
        while message is not None:
            if message.arbitration_id == REQUEST:
                for data in self._faulted(bytes(message.data)):
                    self.node.send(frame(data))
            message = bus.recv(0)

    def _from_node(self, bus: can.BusABC) -> bool:
        wait = 0.002
        while select.select([self.node], [], [], wait)[0]:
            answer = self.node.recv(16)
            if not answer:
                return False
            can_id, size, content = _FRAME.unpack(answer)
            assert can_id == RESPONSE
            for data in self._faulted(content[:size]):
                bus.send(can.Message(arbitration_id=RESPONSE, data=data, is_extended_id=False))
            wait = 0
        return True

    def _faulted(self, data: bytes) -> list[bytes]:
        self.frames += 1
        return self.fault(self.frames, data)

    def stop(self) -> None:
        self._stop.set()


@contextlib.contextmanager
def running(bridge: Bridge) -> Iterator[None]:
    """A bridge at work."""
    thread = threading.Thread(target=bridge.run, daemon=True)
    thread.start()
    time.sleep(0.05)  # the virtual bus keeps nothing for who joins later
    try:
        yield
    finally:
        bridge.stop()
        thread.join(5)


@contextlib.contextmanager
def bridged(
    node: Node, fault: Fault = passed_on, stop: int | None = None, channel: str = ""
) -> Iterator[str]:
    """Name of a bus that has the node on it, with power."""
    channel = channel or f"device-{next(CHANNELS)}"

    def virtual() -> can.BusABC:
        return can.Bus(interface="virtual", channel=channel)

    with node.on(stop) as link, running(Bridge(virtual, link, fault)):
        yield f"virtual:{channel}"


@contextlib.contextmanager
def linked(
    node: Node,
    fault: Fault = passed_on,
    stop: int | None = None,
    answer_s: float = 0.5,
    store_s: float = 30.0,
) -> Iterator[Link]:
    with (
        bridged(node, fault, stop) as name,
        contextlib.closing(
            Link(open_bus(name, fd=False), name, answer_s=answer_s, store_s=store_s)
        ) as link,
    ):
        yield link
