"""A bus of python-can in both directions."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import can

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.bus.messages import frames_of, messages_of
from triaxcal.rig.bus.openbus import open_bus

_SEND_S = 5.0
"""Longest wait for room in the queue of a device."""
_AT_ONCE = 4096


class BusPort:
    """A bus, open."""

    def __init__(self, bus: can.BusABC, name: str) -> None:
        self._bus, self._name = bus, name

    def send(self, frames: Frames) -> None:
        """Send frames in their order.

        Raises
        ------
        RefusedError
            When the bus takes none.
        """
        try:
            for message in messages_of(frames):
                message.timestamp = 0.0
                self._bus.send(message, timeout=_SEND_S)
        except (can.CanError, OSError) as error:
            raise RefusedError(self._name, f"cannot be written: {error}") from error

    def receive(self, wait_s: float) -> Frames:
        """Frames that have come.

        Raises
        ------
        RefusedError
            When the bus cannot be read.
        """
        messages: list[can.Message] = []
        try:
            message = self._bus.recv(wait_s)
            while message is not None:
                messages.append(message)
                message = self._bus.recv(0) if len(messages) < _AT_ONCE else None
        except (can.CanError, OSError) as error:
            raise RefusedError(self._name, f"cannot be read: {error}") from error
        return frames_of(messages)


@contextlib.contextmanager
def port_of(name: str, fd: bool) -> Iterator[BusPort]:
    """The bus that --bus names: a CAN device, or one of python-can.

    Raises
    ------
    UsageError, RefusedError
        When there is none.
    """
    bus = open_bus(name if ":" in name else f"socketcan:{name}", fd)
    try:
        yield BusPort(bus, name)
    finally:
        bus.shutdown()
