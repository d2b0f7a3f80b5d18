"""Several buses read in one loop."""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping

from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.sources.source import WAIT_S, Source

_QUEUE = 1024
"""Batches of one bus that may wait: 20 s and more."""


class _Reader:
    """One source in a thread of its own, so that none waits for another.

    Attributes
    ----------
    error : Exception or None
        Why it gives no more; what came before has been taken.
    """

    def __init__(self, source: Source) -> None:
        self.error: Exception | None = None
        self._source = source
        self._queue: queue.Queue[Frames | Exception] = queue.Queue(_QUEUE)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                found: Frames | Exception = self._source.read()
            except Exception as error:  # raised where the frames are asked for
                found = error
            while not self._stop.is_set():
                try:
                    self._queue.put(found, timeout=0.2)
                    break
                except queue.Full:
                    continue
            if isinstance(found, Exception):
                return

    def take(self, wait_s: float) -> list[Frames]:
        """Batches that have come."""
        found: list[Frames] = []
        try:
            while True:
                item = self._queue.get(timeout=0.0 if found else wait_s)
                if isinstance(item, Exception):
                    self.error = item
                    return found
                found.append(item)
        except queue.Empty:
            return found

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join(2.0)


class Gathered:
    """Sources of a session by the names of their buses.

    Parameters
    ----------
    in_step : bool
        They are read one after the other: where the time is simulated.
    """

    def __init__(self, sources: Mapping[str, Source], in_step: bool = False) -> None:
        self.sources = dict(sources)
        self._readers: dict[str, _Reader] = {}
        if not in_step and len(self.sources) > 1:
            self._readers = {bus: _Reader(source) for bus, source in self.sources.items()}

    def read(self) -> list[tuple[str, Frames]]:
        """Frames that have come, with their buses; waits a little when there are none.

        Raises
        ------
        RefusedError
            When a bus cannot be read any more.
        """
        if not self._readers:
            return [(bus, source.read()) for bus, source in self.sources.items()]
        for reader in self._readers.values():
            if reader.error is not None:
                raise reader.error
        return [
            (bus, frames)
            for bus, reader in self._readers.items()
            for frames in reader.take(WAIT_S / len(self._readers))
        ]

    def notes(self) -> list[str]:
        """What happened to the connections since last asked."""
        return [note for source in self.sources.values() for note in source.notes()]

    def close(self) -> None:
        """Give the channels back."""
        for reader in self._readers.values():
            reader.close()
        for source in self.sources.values():
            source.close()
