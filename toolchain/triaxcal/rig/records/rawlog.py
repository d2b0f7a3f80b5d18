"""The evidence: every frame as it came, appended to a candump log in batches."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from triaxcal.base.durable import BINARY, sync_data, sync_folder, write_all
from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.logs.linelog import log_text
from triaxcal.rig.records.journal import disk_refusal

LogState = dict[str, int | str]
"""Lines, bytes and SHA-256 of a log."""

_BATCH_BYTES = 1 << 16
_HASH_BYTES = 8 << 20
"""Hashed at most with one flush: 20 ms, while the queue holds a second of a full bus."""


class RawLog:
    """A log open for appending: candump text, or the lines of a source that speaks in lines.

    Attributes
    ----------
    lines : int
        Whole lines in it, those not yet flushed included.
    """

    def __init__(self, path: Path, channel: str, known: LogState | None = None) -> None:
        """Open a log, a new one or one to go on with; a torn last line is cut off.

        Parameters
        ----------
        known : LogState, optional
            What the log began with when its journal was last written. Only what follows is read
            now; the beginning is hashed little by little, with the flushes.

        Raises
        ------
        RefusedError
            When the disk refuses, or the log is shorter than what is known of it.
        """
        self.path = path
        self._known = known
        self.lines = int(known["lines"]) if known else 0
        self._channel = channel
        self._hash = hashlib.sha256()
        self._hashed = 0
        self._waiting: list[bytes] = []
        self._waiting_bytes = 0
        self._size = int(known["bytes"]) if known else 0
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | BINARY, 0o644)
            self._take_up()
            sync_folder(path.parent)
        except OSError as error:
            raise disk_refusal(path, error) from error

    def _take_up(self) -> None:
        found = os.fstat(self._file).st_size
        if found < self._size:
            raise changed_log(self.path, f"it has {found} bytes", f"{self._size} or more")
        at, rest = self._size, b""
        while chunk := self._read(1 << 20, at):
            at += len(chunk)
            cut = chunk.rfind(b"\n") + 1
            if not cut:
                rest += chunk
                continue
            self._size += len(rest) + cut
            self.lines += chunk.count(b"\n")
            rest = chunk[cut:]
        os.ftruncate(self._file, self._size)

    def _read(self, count: int, at: int) -> bytes:
        """Bytes of the file; writing is always at its end."""
        os.lseek(self._file, at, os.SEEK_SET)
        return os.read(self._file, count)

    def append(self, frames: Frames) -> None:
        """Add frames; they reach the file with the next `flush`, or when many wait.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        if not len(frames):
            return
        text = log_text(frames, self._channel)
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
                self._size += len(text)
                self._waiting, self._waiting_bytes = [], 0
            if sync:
                sync_data(self._file)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            self._waiting, self._waiting_bytes = [], 0
            raise disk_refusal(self.path, error) from error
        self._hash_on(_HASH_BYTES)

    def _hash_on(self, most: int) -> None:
        """Hash some more of the file; refuse it when its beginning is not what is known."""
        while self._hashed < self._size and most > 0:
            seam = int(self._known["bytes"]) if self._known else self._size
            end = seam if self._hashed < seam else self._size
            chunk = self._read(min(1 << 20, end - self._hashed), self._hashed)
            if not chunk:
                raise changed_log(self.path, f"it ends at byte {self._hashed}", f"{end} bytes")
            self._hash.update(chunk)
            self._hashed += len(chunk)
            most -= len(chunk)
            if self._known and self._hashed == seam:
                found, expected = self._hash.hexdigest(), str(self._known["sha256"])
                self._known = None
                if found != expected:
                    raise changed_log(
                        self.path,
                        f"its first {seam} bytes have SHA-256 {found[:16]}...",
                        f"{expected[:16]}..., as the journal recorded",
                    )

    @property
    def place(self) -> LogState:
        """Lines and bytes of what has been flushed."""
        return {"lines": self.lines, "bytes": self._size}

    @property
    def state(self) -> LogState:
        """Lines, bytes and SHA-256 of what has been flushed; no hash while much is still unread.

        After a resume the beginning is hashed with the flushes: an event must not wait for it.
        """
        self._hash_on(_HASH_BYTES)
        if self._hashed < self._size:
            return self.place
        return {**self.place, "sha256": self._hash.hexdigest()}

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


def changed_log(path: Path, found: str, expected: str) -> RefusedError:
    """Error of a log that is not the one its journal was written beside."""
    return RefusedError(
        str(path),
        found,
        expected=expected,
        remedy="the log was changed or cut after the session; the journal still holds the "
        "accepted dwells: `triaxcal rig status`",
    )
