"""The evidence: every frame as it came, appended to a candump log in batches."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from triaxcal.rig.candump import format_frames
from triaxcal.rig.frames import Frames
from triaxcal.rig.journal import disk_refusal, sync_folder, write_all

_BATCH_BYTES = 1 << 16


class RawLog:
    """A candump log open for appending.

    Attributes
    ----------
    lines : int
        Whole lines in it, those not yet flushed included.
    """

    def __init__(self, path: Path, channel: str) -> None:
        """Open a log, a new one or one to go on with; a torn last line is cut off.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        self.path = path
        self.lines = 0
        self._channel = channel
        self._hash = hashlib.sha256()
        self._waiting: list[bytes] = []
        self._waiting_bytes = self._size = 0
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            self._take_up()
            sync_folder(path.parent)
        except OSError as error:
            raise disk_refusal(path, error) from error

    def _take_up(self) -> None:
        rest = b""
        while chunk := os.read(self._file, 1 << 20):
            cut = chunk.rfind(b"\n") + 1
            if not cut:
                rest += chunk
                continue
            whole = rest + chunk[:cut]
            rest = chunk[cut:]
            self._hash.update(whole)
            self.lines += whole.count(b"\n")
            self._size += len(whole)
        os.ftruncate(self._file, self._size)
        os.lseek(self._file, self._size, os.SEEK_SET)

    def append(self, frames: Frames) -> None:
        """Add frames; they reach the file with the next `flush`, or when many wait.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        if not len(frames):
            return
        text = format_frames(frames, self._channel)
        self._waiting.append(text)
        self._waiting_bytes += len(text)
        self.lines += len(frames)
        if self._waiting_bytes >= _BATCH_BYTES:
            self.flush()

    def flush(self, sync: bool = False) -> None:
        """Give what waits to the system; with `sync`, wait until the disk has it.

        Raises
        ------
        RefusedError
            When the disk refuses; the log then ends with a whole line.
        """
        try:
            if self._waiting:
                text = b"".join(self._waiting)
                write_all(self._file, text)
                self._hash.update(text)
                self._size += len(text)
                self._waiting, self._waiting_bytes = [], 0
            if sync:
                os.fdatasync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
            self._waiting, self._waiting_bytes = [], 0
            raise disk_refusal(self.path, error) from error

    @property
    def state(self) -> dict[str, int | str]:
        """Lines, bytes and SHA-256 of what has been flushed."""
        return {"lines": self.lines, "bytes": self._size, "sha256": self._hash.hexdigest()}

    def close(self) -> None:
        """Flush and close.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        try:
            self.flush()
        finally:
            os.close(self._file)
