"""The text of a log by whole lines: plain or compressed, with or without a byte order mark."""

from __future__ import annotations

import codecs
import gzip
import io
import zlib
from collections.abc import Generator
from pathlib import Path
from typing import IO, Protocol

from triaxcal.base.errors import RefusedError, refused_by_system

_GZIP = b"\x1f\x8b"
_WIDE = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
"""What a console of Windows writes."""
_LONGEST = 1 << 16
"""Bytes of a line at most; what is longer is no line of a log."""


ARCHIVE_ERRORS = (EOFError, gzip.BadGzipFile, zlib.error)


def damaged_archive(path: Path, error: Exception) -> RefusedError:
    """Error of a compressed file that cannot be unpacked to its end."""
    remedy = "unpack what is there (`gzip -dc`), and give that file"
    return RefusedError(str(path), f"damaged: {error}", remedy=remedy)


class Readable(Protocol):
    """What bytes are read from."""

    def read(self, size: int, /) -> bytes:
        """Some of them; none at the end."""


def whole_lines(
    path: Path, start: int, end: int | None, piece: int
) -> Generator[bytes, None, None]:
    """Text of a file, cut behind ends of lines; the last part may lack one.

    Parameters
    ----------
    start, end : int
        Bytes of a plain file to read; `end` None is its end.
    piece : int
        Bytes read at once.

    Raises
    ------
    RefusedError
        When the file cannot be read, or its compression is damaged.
    """
    try:
        with path.open("rb") as file:
            stream = _plain(file) if start == 0 and end is None else _part(file, start, end)
            yield from _cut(stream, piece)
    except ARCHIVE_ERRORS as error:
        raise damaged_archive(path, error) from error
    except OSError as error:
        raise refused_by_system(path, "read", error) from error


def _plain(file: IO[bytes]) -> Readable:
    """A file's text in ASCII, or what is nearest to it."""
    packed = file.read(2) == _GZIP
    file.seek(0)
    stream = gzip.GzipFile(fileobj=file) if packed else file
    head = stream.read(3)
    stream.seek(0)
    if head == codecs.BOM_UTF8:
        stream.seek(3)
    elif coding := _WIDE.get(head[:2]):
        stream.seek(2)
        return _Recoded(stream, coding)
    return stream


def _part(file: IO[bytes], start: int, end: int | None) -> Readable:
    """Some bytes of a file."""
    file.seek(start)
    return file if end is None else io.BytesIO(file.read(max(0, end - start)))


class _Recoded:
    """Text of wide characters as ASCII."""

    def __init__(self, stream: Readable, coding: str) -> None:
        self._stream = stream
        self._decoder = codecs.getincrementaldecoder(coding)("replace")

    def read(self, size: int, /) -> bytes:
        """Some of the text."""
        raw = self._stream.read(size)
        return self._decoder.decode(raw, not raw).encode("ascii", "replace")


def _cut(stream: Readable, piece: int) -> Generator[bytes, None, None]:
    rest = b""
    while chunk := stream.read(piece):
        cut = chunk.rfind(b"\n") + 1
        if cut:
            yield rest + chunk[:cut]
            rest = b""
        rest += chunk[cut:]
        if len(rest) > _LONGEST:
            rest = rest[:_LONGEST]  # whatever follows, it is no frame any more
    if rest:
        yield rest
