"""Both directions of the bus of a node: a socket between two processes, or any bus."""

from __future__ import annotations

import select
import socket
from typing import Protocol

from triaxcal.rig.bus.burst import FD_BYTES
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.sources.socketcan import frames_of_rows, packed


class Port(Protocol):
    """What frames are sent to and received from."""

    def send(self, frames: Frames) -> None:
        """Send frames in their order."""

    def receive(self, wait_s: float) -> Frames:
        """Frames that have come; none only after `wait_s` seconds without any."""


class SocketPort:
    """A socket that carries struct can_frame and canfd_frame."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link

    def send(self, frames: Frames) -> None:
        """Send frames in their order."""
        for frame in packed(frames):
            self._link.send(frame)

    def receive(self, wait_s: float) -> Frames:
        """Frames that have come."""
        rows: list[tuple[int, bytes]] = []
        while select.select([self._link], [], [], 0.0 if rows else wait_s)[0]:
            payload = self._link.recv(FD_BYTES)
            if not payload:
                break
            rows.append((0, payload))
        return frames_of_rows(rows)
