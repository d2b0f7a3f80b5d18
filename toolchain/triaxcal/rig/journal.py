"""The journal of a session: append-only, every record framed by a CRC and on the disk at once.

One record a line: eight hex digits of CRC-32, a space, JSON. The CRC runs over the one before and
the JSON, so a record that was changed, moved or taken out breaks the chain. What stands behind
the first broken record is not used.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, refused_by_system

Record = Mapping[str, Any]


@dataclass(frozen=True)
class ReadJournal:
    """Records of a journal that can be used.

    Attributes
    ----------
    good_bytes : int
        Length of the part that holds them.
    crc : str
        Last link of the chain.
    torn : bool
        A record at the end is incomplete: it was never acknowledged.
    damaged : bool
        More than one record's worth follows the break: not a crash, but damage.
    """

    records: tuple[Record, ...]
    good_bytes: int
    crc: str
    torn: bool
    damaged: bool


def read_journal(path: Path) -> ReadJournal:
    """Records of a journal up to the first that is broken.

    Raises
    ------
    RefusedError
        When the file cannot be read.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise RefusedError(str(path), f"cannot be read: {error.strerror}") from error
    records: list[Record] = []
    crc, at = _START, 0
    while True:
        end = text.find(b"\n", at)
        line = text[at:end] if end >= 0 else b""
        if end < 0 or line[:9] != _link(crc, line[9:]) + b" ":
            break
        records.append(json.loads(line[9:]))
        crc, at = line[:8], end + 1
    rest = text[at:]
    return ReadJournal(tuple(records), at, crc.decode(), bool(rest), b"\n" in rest.rstrip(b"\0\n"))


class Journal:
    """A journal open for appending; what `append` has returned from is on the disk."""

    def __init__(self, path: Path) -> None:
        """Open a journal, a new one or one to go on with; a torn end is cut off.

        Raises
        ------
        RefusedError
            When the disk refuses, or the journal is damaged.
        """
        self.path = path
        self._crc = _START
        self._size = 0
        if path.exists():
            found = read_journal(path)
            if found.damaged:
                raise RefusedError(
                    str(path),
                    f"damaged behind its {len(found.records)} good records",
                    remedy="keep it, and rebuild the records with `triaxcal rig replay`",
                )
            self._crc, self._size = found.crc.encode(), found.good_bytes
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644)
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, 0, os.SEEK_END)
            os.fsync(self._file)
            sync_folder(path.parent)
        except OSError as error:
            raise disk_refusal(path, error) from error

    def append(self, record: Record) -> None:
        """Add one record and wait until the disk has it.

        Raises
        ------
        RefusedError
            When the disk refuses; the journal is then as it was.
        """
        text = json.dumps(record, separators=(",", ":"), sort_keys=True).encode()
        link = _link(self._crc, text)
        line = link + b" " + text + b"\n"
        try:
            write_all(self._file, line)
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._size)
            raise disk_refusal(self.path, error) from error
        self._crc = link
        self._size += len(line)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


_START = b"00000000"


def _link(before: bytes, text: bytes) -> bytes:
    return b"%08x" % zlib.crc32(before + text)


def write_all(file: int, content: bytes) -> None:
    """Write all of it: the system may take a part only."""
    view = memoryview(content)
    while view:
        view = view[os.write(file, view) :]


def sync_folder(folder: Path) -> None:
    """Make the names in a folder survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def disk_refusal(path: Path, error: OSError) -> RefusedError:
    """Error of a disk that refuses."""
    remedy = "what was acknowledged is safe; free some space, then `triaxcal rig resume`"
    return refused_by_system(path, "written", error, remedy=remedy)
