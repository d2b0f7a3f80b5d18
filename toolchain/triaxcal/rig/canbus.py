"""Buses of python-can, and the simulated rig on one of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import can
import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.busload import BitRates
from triaxcal.rig.frames import (
    BRS,
    EFF_FLAG,
    ERR_FLAG,
    ESI,
    ID_MASK,
    RTR_FLAG,
    SENT,
    Frames,
    empty,
    without_channel,
)
from triaxcal.rig.simulator import SimulatedRig
from triaxcal.rig.source import PACE_S, WAIT_S, Watched

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


def frames_of(messages: list[can.Message]) -> Frames:
    """Frames of python-can messages."""
    if not messages:
        return empty()
    # Some files do not say that a frame is CAN FD, and some readers call an empty one remote.
    fd = [m.is_fd or len(m.data) > 8 for m in messages]
    remote = [m.is_remote_frame and not m.is_fd for m in messages]
    width = 64 if any(fd) else 8
    count = len(messages)
    payload = b"".join(bytes(m.data).ljust(width, b"\0") for m in messages)
    ids = [
        m.arbitration_id
        | (EFF_FLAG if m.is_extended_id and not m.is_error_frame else 0)
        | (RTR_FLAG if is_remote else 0)
        | (ERR_FLAG if m.is_error_frame else 0)
        for m, is_remote in zip(messages, remote, strict=True)
    ]
    lengths = [m.dlc if r else len(m.data) for m, r in zip(messages, remote, strict=True)]
    marks = [
        (BRS if m.bitrate_switch else 0)
        | (ESI if m.error_state_indicator else 0)
        | (0 if m.is_rx else SENT)
        for m in messages
    ]
    channels = [b"" if m.channel is None else str(m.channel).encode() for m in messages]
    return Frames(
        np.array([round(m.timestamp * 1e6) * 1000 for m in messages], np.int64),
        np.array(ids, np.uint32),
        np.array(lengths, np.uint8),
        np.array(fd, np.bool_),
        np.frombuffer(payload, np.uint8).reshape(count, width),
        np.array(marks, np.uint8),
        np.array(channels, np.bytes_),
    )


def messages_of(frames: Frames) -> list[can.Message]:
    """Python-can messages of frames."""
    rows = zip(
        frames.t_ns.tolist(),
        frames.can_id.tolist(),
        frames.length.tolist(),
        frames.fd.tolist(),
        frames.data,
        frames.marks.tolist(),
        frames.channel.tolist(),
        strict=True,
    )
    return [
        can.Message(
            timestamp=t_ns / 1e9,
            arbitration_id=can_id & ID_MASK,
            is_extended_id=bool(can_id & EFF_FLAG),
            is_remote_frame=bool(can_id & RTR_FLAG),
            is_error_frame=bool(can_id & ERR_FLAG),
            is_fd=fd,
            dlc=length,
            data=None if can_id & RTR_FLAG else data[:length].tobytes(),
            bitrate_switch=bool(marks & BRS),
            error_state_indicator=bool(marks & ESI),
            is_rx=not marks & SENT,
            channel=channel.decode() or None,
        )
        for t_ns, can_id, length, fd, data, marks, channel in rows
    ]
