"""Files that python-can reads."""

from __future__ import annotations

import importlib.util
import io
import logging
import re
import struct
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.rig.logs.candump import Parsed
from triaxcal.rig.logs.logfile import LogFormat

SUFFIXES = (".asc", ".blf", ".db", ".mf4", ".trc")
_PIECE = 1 << 14
_CLASSIC = 8
"""Bytes of a classic frame."""
_BLF_HEAD, _BLF_OBJECT = struct.Struct("<4sI"), struct.Struct("<8xII")
_BLF_SIZE, _BLF_SIZE_AT = struct.Struct("<Q"), 16
"""Of BLF: signature and size of the file's head; signature, versions, size and type of an object
(8 bytes are skipped, as the type is not used); the size of the whole file in its head."""
_NO_FRAMES = re.compile(
    r"\s*(|date .*|base .*|(no )?internal events logged.*|//.*|;.*|begin triggerblock.*"
    r"|end triggerblock.*|[\d.]+\s+start of measurement.*)\s*",
    re.IGNORECASE,
)
"""Lines of a text that are not meant to be frames."""


class _Text:
    """A text, its head, and how many lines so far may be frames."""

    def __init__(self, file: TextIO) -> None:
        self.file = file
        self.head: list[str] = []
        self.counted = 0

    def __next__(self) -> str:
        line = next(self.file)
        if not _NO_FRAMES.fullmatch(line):
            self.counted += 1
        elif not self.counted:
            self.head.append(line)
        return line

    def messages(self, kind: Any, options: dict[str, Any]) -> Iterator[Any]:
        """Messages of a reader; behind a line that it cannot bear, those of another reader.

        Raises
        ------
        Exception
            What it raises in the head, and where no line is a message.
        """
        first: Exception | None = None
        found = False
        while True:
            before = self.counted
            try:
                for message in kind(_Lines(self), **options):
                    found = True
                    yield message
            except Exception as error:  # each reader raises what its maker chose
                first = first or error
                if self.counted == before:
                    raise
                continue
            if first is not None and not found:
                raise first
            return


class _Lines(io.StringIO):
    """Lines of a text behind its head, which has been read; python-can takes it for a file."""

    def __init__(self, text: _Text) -> None:
        super().__init__()
        self._text = text
        self._head = list(reversed(text.head))

    def __next__(self) -> str:  # type: ignore[override]  # a StringIO gives str
        return self._head.pop() if self._head else next(self._text)


def _read(path: Path) -> Generator[Parsed, None, None]:
    if path.suffix.lower() == ".mf4" and importlib.util.find_spec("asammdf") is None:
        remedy = "install it: " + install_command("export")
        raise RefusedError(str(path), "missing package: asammdf", remedy=remedy)
    try:
        yield from _pieces(path, relative=False)
    except ValueError as error:
        if "datetime string" not in str(error):
            raise
        # The date in the head of an ASC file is in another language: times from its beginning.
        yield from _pieces(path, relative=True)


def _pieces(path: Path, relative: bool) -> Generator[Parsed, None, None]:
    from triaxcal.rig.bus.messages import frames_of  # noqa: PLC0415  python-can takes its time

    before = 0
    with _opened(path, relative) as (messages, lines):
        while True:
            with _said() as said:
                piece = list(islice(messages, _PIECE))
            for message in piece:
                # A database has no flag of CAN FD.
                message.is_fd = message.is_fd or len(message.data) > _CLASSIC
            good = [message for message in piece if _is_whole(message)]
            counted = lines.counted if lines is not None else before + len(piece) + len(said)
            bad = max(0, counted - before - len(good))
            before = counted
            if piece or bad:
                first = repr(said[0]) if said else ""
                yield Parsed(frames_of(good), len(good) + bad, bad, first_bad=first)
            if len(piece) < _PIECE:
                break
    if path.suffix.lower() == ".blf" and (cut := _cut_blf(path)):
        yield Parsed(frames_of([]), 0, 0, cut=cut)


def _cut_blf(path: Path) -> str:
    """What a BLF file lacks at its end, of which its reader says nothing; "" for nothing."""
    size = path.stat().st_size
    with path.open("rb") as file:
        _, head_bytes = _BLF_HEAD.unpack(file.read(_BLF_HEAD.size))
        file.seek(_BLF_SIZE_AT)
        (written,) = _BLF_SIZE.unpack(file.read(_BLF_SIZE.size))
        at = int(head_bytes)
        while at + _BLF_OBJECT.size <= size:
            file.seek(at)
            object_bytes, _ = _BLF_OBJECT.unpack(file.read(_BLF_OBJECT.size))
            at += max(int(object_bytes) + int(object_bytes) % 4, _BLF_OBJECT.size)
    # The padding of the last object may be absent.
    if at - 3 > size or at < size or written > size:
        return f"cut at byte {size}, the frames behind are lost"
    return ""


def _is_whole(message: Any) -> bool:
    """Whether a message has its payload: one of a torn line has less."""
    if message.is_remote_frame or message.is_error_frame:
        return True
    size: int = len(message.data)
    return size == (int(message.dlc) if message.is_fd else min(int(message.dlc), _CLASSIC))


@contextmanager
def _opened(path: Path, relative: bool) -> Iterator[tuple[Iterator[Any], _Text | None]]:
    """Messages of a file, and its lines where it is a text."""
    from can.io.generic import BinaryIOMessageReader, TextIOMessageReader  # noqa: PLC0415
    from can.io.player import MESSAGE_READERS  # noqa: PLC0415

    kind: Any = MESSAGE_READERS[path.suffix.lower()]
    options = {"relative_timestamp": relative} if path.suffix.lower() == ".asc" else {}
    if issubclass(kind, BinaryIOMessageReader):
        with path.open("rb") as binary, kind(binary) as reader:
            yield iter(reader), None
        return
    if not issubclass(kind, TextIOMessageReader):
        with kind(str(path)) as reader:
            yield iter(reader), None
        return
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        text = _Text(file)
        yield text.messages(kind, options), text


@contextmanager
def _said() -> Iterator[list[str]]:
    """What python-can says of a file, which would stand on the screen."""
    said: list[str] = []

    class Collected(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    logger, handler = logging.getLogger("can"), Collected(logging.WARNING)
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates


ENTRY = LogFormat(
    name="python-can",
    label="a file of ASC, BLF, SQLite (.db), MF4 or TRC",
    doc="By python-can: .asc, .blf, .db, .mf4 (bus logging) and .trc. A .db has no CAN FD "
    "flag: frames of more than eight bytes are CAN FD.",
    takes=lambda name, head: name.endswith(SUFFIXES),  # noqa: ARG005
    read=_read,
    rank=20,
)
