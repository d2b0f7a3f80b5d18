"""The journal of a session: append-only, every record framed by a CRC and on the disk at once.

One record a line: eight hex digits of CRC-32, a space, JSON. The CRC runs over the one before and
the JSON, so a record that was changed, moved or taken out breaks the chain. What stands behind
the first broken record is not used, until `mend` has joined what is whole with it.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from triaxcal.base.durable import BINARY, sync_folder, write_all
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
        A whole line follows the break: not a crash, but damage.
    later : tuple of Record
        Records behind the break that are whole, each checked against the link of the one before.
    lost : int
        Lines behind the break that are not.
    """

    records: tuple[Record, ...]
    good_bytes: int
    crc: str
    torn: bool
    damaged: bool
    later: tuple[Record, ...] = ()
    lost: int = 0


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
        if end < 0 or not _whole(crc, line):
            break
        records.append(json.loads(line[9:]))
        crc, at = line[:8], end + 1
    # A disk that lost its power may have left zeros.
    rest = text[at:].rstrip(b"\0")
    later, lost = _behind(crc, rest)
    damaged = bool(later) or b"\n" in rest
    return ReadJournal(tuple(records), at, crc.decode(), bool(text[at:]), damaged, later, lost)


def _behind(crc: bytes, rest: bytes) -> tuple[tuple[Record, ...], int]:
    """Whole records of a text that begins with a broken one, and the number of broken ones."""
    if _whole(crc, rest[:-1]):  # the last record, and the end of its line was changed
        return (json.loads(rest[9:-1]),), 0
    lines = rest.removesuffix(b"\n").split(b"\n")
    whole = [b for a, b in pairwise(lines) if _whole(a[:8], b)]
    return tuple(json.loads(line[9:]) for line in whole), len(lines) - len(whole)


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
                    remedy="`triaxcal rig resume` shows what is whole and goes on from there",
                )
            self._crc, self._size = found.crc.encode(), found.good_bytes
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | BINARY, 0o644)
            os.ftruncate(self._file, self._size)
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
        line = framed(self._crc, record)
        try:
            write_all(self._file, line)
            os.fsync(self._file)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            raise disk_refusal(self.path, error) from error
        self._crc = line[:8]
        self._size += len(line)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


_START = b"00000000"


def framed(before: bytes, record: Record) -> bytes:
    """Line of a record behind one of this link."""
    text = json.dumps(record, separators=(",", ":"), sort_keys=True).encode()
    return _link(before, text) + b" " + text + b"\n"


def written(records: Iterable[Record]) -> bytes:
    """A whole journal of these records."""
    lines: list[bytes] = []
    for record in records:
        lines.append(framed(lines[-1][:8] if lines else _START, record))
    return b"".join(lines)


def _link(before: bytes, text: bytes) -> bytes:
    return b"%08x" % zlib.crc32(before + text)


def _whole(before: bytes, line: bytes) -> bool:
    return len(line) > 9 and line[:9] == _link(before, line[9:]) + b" "


def disk_refusal(path: Path, error: OSError) -> RefusedError:
    """Error of a disk that refuses."""
    remedy = "what was acknowledged is safe; free some space, then `triaxcal rig resume`"
    return refused_by_system(path, "written", error, remedy=remedy)
