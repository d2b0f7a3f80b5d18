"""Buses of python-can, and the simulated rig on one of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import can

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.busload import BitRates
from triaxcal.rig.bus.frames import (
    Frames,
    without_channel,
)
from triaxcal.rig.bus.messages import frames_of, messages_of
from triaxcal.rig.simulated.simulator import SimulatedRig
from triaxcal.rig.sources.source import PACE_S, WAIT_S, Watched

Bus = can.BusABC
"""A bus of python-can, which this room alone imports."""


_SIMULATED = BitRates(1_000_000, 8_000_000)
"""What the simulated rig's times are made for."""


class BusSource(Watched):
    """Any bus that python-can opens."""

    def __init__(self, bus: can.BusABC, name: str) -> None:
        super().__init__(name)
        self.bus = bus

    def read(self) -> Frames:
        """Frames that have come.

        Raises
        ------
        RefusedError
            When the bus cannot be read any more.
        """
        messages: list[can.Message] = []
        try:
            message = self.bus.recv(WAIT_S)
            if message is not None:
                time.sleep(PACE_S)
            while message is not None and len(messages) < 4096:
                messages.append(message)
                message = self.bus.recv(0)
            if message is not None:
                messages.append(message)
        except (can.CanError, OSError) as error:
            raise RefusedError(
                self.name, f"cannot be read: {error}", remedy="then `triaxcal rig resume`"
            ) from error
        self._watch(bool(messages))
        return without_channel(frames_of(messages))  # the log has the source's name

    def close(self) -> None:
        """Shut the bus down."""
        self.bus.shutdown()


class VirtualSource:
    """Frames that are made, behind a python-can virtual bus, in a clock as fast as the machine.

    Parameters
    ----------
    advance : callable
        Makes the frames of the next second.
    """

    def __init__(self, advance: Callable[[], Frames], name: str = "virtual") -> None:
        self.name = name
        self.rates: BitRates | None = _SIMULATED
        self._advance = advance
        options: dict[str, Any] = {"interface": "virtual", "preserve_timestamps": True}
        self._out = can.Bus(channel=f"triaxcal-{id(self)}", **options)
        self._in = can.Bus(channel=f"triaxcal-{id(self)}", **options)

    def read(self) -> Frames:
        """Frames of the next second, through the bus."""
        sent = messages_of(self._advance())
        for message in sent:
            self._out.send(message)
        received = [self._in.recv(1.0) for _ in sent]
        return without_channel(frames_of([m for m in received if m is not None]))

    def notes(self) -> list[str]:
        """Nothing ever happens to this connection."""
        return []

    def close(self) -> None:
        """Shut both ends down."""
        self._in.shutdown()
        self._out.shutdown()


class SimulatedSource(VirtualSource):
    """The simulated rig behind a virtual bus."""

    def __init__(self, rig: SimulatedRig, name: str = "virtual") -> None:
        super().__init__(rig.advance, name)
        self.rig = rig
