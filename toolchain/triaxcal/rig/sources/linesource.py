"""Sources that speak in lines: what is shared by a serial port and an instrument."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.lines import LineFormat, frames_of_lines
from triaxcal.rig.sources.source import Watched

_AGAIN_S = 0.2
"""Between two tries to open a port that is gone."""


class Port(Protocol):
    """An open connection; its calls raise any `Exception` when it is lost."""

    def lines(self) -> Sequence[bytes]:
        """Lines that have come, without their ends; waits a little when there are none."""

    def close(self) -> None:
        """Give it back."""


class LineSource(Watched):
    """Lines of a port as frames; a port that goes away is opened again.

    Parameters
    ----------
    connect : callable
        Opens the port.
    """

    def __init__(self, name: str, lines: LineFormat, connect: Callable[[], Port]) -> None:
        """Open it.

        Raises
        ------
        RefusedError
            When it cannot be opened.
        """
        super().__init__(name)
        self._format = lines
        self._connect = connect
        self._port: Port | None = connect()

    def read(self) -> Frames:
        """Lines that have come."""
        texts: Sequence[bytes] = ()
        if self._port is None:
            time.sleep(_AGAIN_S)
            self._reopen()
        else:
            try:
                texts = self._port.lines()
            except Exception as error:  # each library raises what its maker chose
                self._lose(error)
        now = time.time_ns()
        self._watch(bool(texts))
        return frames_of_lines(self._format, [now] * len(texts), texts)

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()

    def _reopen(self) -> None:
        try:
            self._port = self._connect()
        except RefusedError:
            return
        self._notes.append(f"{self.name}: it is back")

    def _lose(self, error: Exception) -> None:
        port, self._port = self._port, None
        self._down = True
        self._notes.append(f"{self.name}: lost: {' '.join(str(error).split())}")
        if port is not None:
            try:
                port.close()
            except Exception:
                self._notes.append(f"{self.name}: cannot be closed")
