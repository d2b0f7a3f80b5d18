"""Several buses read at once, each in a thread of its own."""

from __future__ import annotations

import threading
import time

import can
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import empty
from triaxcal.rig.sources.canbus import BusSource
from triaxcal.rig.sources.gather import Gathered


def bus(name):
    return can.Bus(interface="virtual", channel=f"gather-{name}")


def test_frames_of_two_buses_come_in_the_order_of_each():
    buses = {name: bus(name) for name in ("one", "two")}
    sources = Gathered({name: BusSource(bus(name), name) for name in buses})
    for number in range(300):
        for shift, sender in enumerate(buses.values()):
            sender.send(can.Message(arbitration_id=shift + 2 * number, is_extended_id=True))
    found = {name: [] for name in buses}
    while sum(map(len, found.values())) < 600:
        for name, frames in sources.read():
            found[name] += (frames.can_id & 0x1FFFFFFF).tolist()
    assert found["one"] == list(range(0, 600, 2))
    assert found["two"] == list(range(1, 600, 2))
    sources.close()
    for sender in buses.values():
        sender.shutdown()


def read_on(sources):
    while True:
        sources.read()


class Lost:
    """A bus that is lost after some reads."""

    def __init__(self, name, reads):
        self.name, self.reads, self.closed = name, reads, False

    def read(self):
        if not self.reads:
            raise RefusedError(self.name, "gone")
        self.reads -= 1
        time.sleep(0.001)
        return empty()

    def notes(self):
        return [f"{self.name}: note"]

    def close(self):
        self.closed = True


def test_a_bus_that_is_lost_is_told_where_the_frames_are_asked_for():
    before = threading.active_count()
    lost = {"a": Lost("a", 10**9), "b": Lost("b", 3)}
    sources = Gathered(lost)
    assert sources.notes() == ["a: note", "b: note"]
    with pytest.raises(RefusedError, match="b: gone"):
        read_on(sources)
    sources.close()
    assert all(source.closed for source in lost.values())
    assert threading.active_count() == before
