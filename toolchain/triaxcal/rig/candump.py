"""The evidence log: text of `candump -L`, written and read many lines at a time.

(1620692699.796900) can0 100#52010A0B0C0D0E0F     classic
(1620692699.796900) can0 110##1<hex>              CAN FD, one digit of flags
(1620692699.796900) can0 100#R                    remote request
(1620692699.796900) can0 20000040#0000000000000000  error frame

A line is taken whole or not at all: a last line without its newline is torn and dropped, a line
with one wrong character is dropped and counted.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import IntArray
from triaxcal.rig.frames import (
    EFF_FLAG,
    ERR_FLAG,
    ID_MASK,
    RTR_FLAG,
    BoolArray,
    ByteArray,
    Frames,
    concatenate,
    empty,
)

NS_PER_US = 1000
_DIGITS = 10  # of whole seconds: from 2001 to 2286
_CHUNK_BYTES = 16 << 20
_FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))

_HEX = np.full(256, 255, np.uint8)
for _value, _char in enumerate(b"0123456789ABCDEF"):
    _HEX[_char] = _value
for _value, _char in enumerate(b"abcdef", start=10):
    _HEX[_char] = _value


@dataclass(frozen=True)
class Parsed:
    """Frames of a text, the number of its whole lines, and of those that were no frame."""

    frames: Frames
    lines: int
    bad_lines: int


def format_frames(frames: Frames, channel: str) -> bytes:
    """Lines of frames; times are cut to whole microseconds."""
    hexes = frames.data.tobytes().hex().upper()
    wide = 2 * frames.data.shape[1]
    lines = []
    columns = zip(
        (frames.t_ns // NS_PER_US).tolist(),
        frames.can_id.tolist(),
        frames.length.tolist(),
        frames.fd.tolist(),
        strict=True,
    )
    for i, (t_us, can_id, length, fd) in enumerate(columns):
        if can_id & ERR_FLAG:
            name = f"{can_id & (ID_MASK | ERR_FLAG):08X}"
        elif can_id & EFF_FLAG:
            name = f"{can_id & ID_MASK:08X}"
        else:
            name = f"{can_id & 0x7FF:03X}"
        body = hexes[i * wide : i * wide + 2 * length]
        if can_id & RTR_FLAG:
            body = "R"
        mark = "##0" if fd else "#"
        lines.append(f"({t_us // 10**6}.{t_us % 10**6:06d}) {channel} {name}{mark}{body}\n")
    return "".join(lines).encode("ascii")


def parse(text: bytes) -> Parsed:
    """Frames of candump text, in its order; what follows the last newline is dropped."""
    buffer = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(buffer == ord("\n"))
    if not len(ends):
        return Parsed(empty(), 0, 0)
    starts = np.concatenate([[0], ends[:-1] + 1])
    hashes = np.flatnonzero(buffer == ord("#"))
    if not len(hashes):
        return Parsed(empty(), len(ends), len(ends))
    first = hashes[np.minimum(np.searchsorted(hashes, starts), len(hashes) - 1)]
    relative = first - starts
    length = ends - starts
    relative[(relative < 0) | (relative >= length)] = 0  # no '#' in this line
    keys = length * 4096 + np.minimum(relative, 4095)
    parts, places = [], []
    left = np.arange(len(keys))
    while len(left):  # a log has lines of a few forms
        key = int(keys[left[0]])
        alike = keys[left] == key
        rows, left = left[alike], left[~alike]
        for frames, kept in _parse_alike(buffer, starts[rows], key // 4096, key % 4096):
            parts.append(frames)
            places.append(rows[kept])
    if not parts:
        return Parsed(empty(), len(ends), len(ends))
    order = np.argsort(np.concatenate(places), kind="stable")
    return Parsed(concatenate(parts).take(order), len(ends), len(ends) - len(order))


def _parse_alike(
    buffer: ByteArray, starts: IntArray, length: int, mark: int
) -> Iterator[tuple[Frames, IntArray]]:
    """Frames of lines of one length with '#' in one place, and which of the lines they are."""
    name_end = _DIGITS + 10
    if mark < name_end + 4 or length > 4000:
        return
    text = sliding_window_view(buffer, length)[starts]
    good = _punctuated(text)
    seconds, s_ok = _decimal(text[:, 1 : 1 + _DIGITS])
    micros, u_ok = _decimal(text[:, 2 + _DIGITS : 8 + _DIGITS])
    t_ns = (seconds * 10**6 + micros) * NS_PER_US
    good &= s_ok & u_ok
    for digits in (3, 8):
        before = mark - digits - 1
        if before < name_end + 1:
            continue
        rows = np.flatnonzero(good & (text[:, before] == ord(" ")))
        if not len(rows):
            continue
        # One space only: the interface's name has none in it.
        rows = rows[_each_row(text[rows, name_end:before] > ord(" "))]
        can_id, ok = _identifier(text[rows, mark - digits : mark], digits)
        is_fd = _is_fd(text, rows, mark, length)
        for payload_at, fd in ((mark + 1, False), (mark + 3, True)):
            chosen = np.flatnonzero(ok & (is_fd == fd))
            if len(chosen) and payload_at <= length:
                kept = rows[chosen]
                yield from _payload(text[kept, payload_at:], t_ns[kept], can_id[chosen], fd, kept)


def _is_fd(text: ByteArray, rows: IntArray, mark: int, length: int) -> BoolArray:
    if mark + 2 >= length:
        return np.zeros(len(rows), np.bool_)
    return np.asarray(
        (text[rows, mark + 1] == ord("#")) & (_HEX[text[rows, mark + 2]] < 16), np.bool_
    )


def _punctuated(text: ByteArray) -> BoolArray:
    return np.asarray(
        (text[:, 0] == ord("("))
        & (text[:, 1 + _DIGITS] == ord("."))
        & (text[:, 8 + _DIGITS] == ord(")"))
        & (text[:, 9 + _DIGITS] == ord(" ")),
        np.bool_,
    )


def _each_row(good: BoolArray) -> BoolArray:
    """`good.all(axis=1)`, quicker where all of it is good."""
    if good.all():
        return np.ones(len(good), np.bool_)
    return np.asarray(good.all(axis=1), np.bool_)


def _decimal(text: ByteArray) -> tuple[IntArray, BoolArray]:
    digits = text - np.uint8(ord("0"))  # what is below "0" comes out far above 9
    value = np.zeros(len(text), np.int64)
    for column in range(text.shape[1]):
        value *= 10
        value += digits[:, column]
    return value, _each_row(digits <= 9)


def _identifier(text: ByteArray, digits: int) -> tuple[IntArray, BoolArray]:
    nibbles = _HEX[text]
    ok = _each_row(nibbles < 16)
    values = np.zeros(len(text), np.int64)
    for column in range(digits):
        values = values << 4 | nibbles[:, column]
    if digits == 3:
        return values, ok & (values <= 0x7FF)
    is_error = (values & ERR_FLAG) != 0
    ok &= values <= (ERR_FLAG | ID_MASK)
    return np.where(is_error, values, values | EFF_FLAG), ok


def _payload(
    text: ByteArray, t_ns: IntArray, can_id: IntArray, fd: bool, kept: IntArray
) -> Iterator[tuple[Frames, IntArray]]:
    """Frames of payload text (n, characters); a remote request is a lone R."""
    characters = text.shape[1]
    if characters == 1 and not fd:
        remote = np.flatnonzero(text[:, 0] == ord("R"))
        if len(remote):
            yield _frames(t_ns[remote], can_id[remote] | RTR_FLAG, 0, fd, None), kept[remote]
        return
    size = characters // 2
    if characters % 2 or size > (64 if fd else 8) or (fd and size not in _FD_LENGTHS):
        return
    nibbles = _HEX[text]
    good = _each_row(nibbles < 16)
    ok = np.flatnonzero(good)
    if len(ok):
        nibbles = nibbles if len(ok) == len(good) else nibbles[ok]
        data: ByteArray = (nibbles[:, 0::2] << np.uint8(4)) | nibbles[:, 1::2]
        yield _frames(t_ns[ok], can_id[ok], size, fd, data), kept[ok]


def _frames(
    t_ns: IntArray, can_id: IntArray, size: int, fd: bool, payload: ByteArray | None
) -> Frames:
    count = len(t_ns)
    data = np.zeros((count, 64 if fd else 8), np.uint8)
    if payload is not None:
        data[:, :size] = payload
    return Frames(
        t_ns,
        can_id.astype(np.uint32),
        np.full(count, size, np.uint8),
        np.full(count, fd, np.bool_),
        data,
    )


def read_log(path: Path, start: int = 0, end: int | None = None) -> Generator[Parsed, None, None]:
    """Frames of a log, a chunk of whole lines at a time.

    Parameters
    ----------
    start, end : int
        Bytes of the file to read; `end` None is its end.

    Raises
    ------
    RefusedError
        When the file cannot be read.
    """
    try:
        with path.open("rb") as log:
            log.seek(start)
            left = (path.stat().st_size if end is None else end) - start
            rest = b""
            while left > 0:
                chunk = log.read(min(_CHUNK_BYTES, left))
                if not chunk:
                    return
                left -= len(chunk)
                cut = chunk.rfind(b"\n") + 1
                if not cut:
                    rest += chunk
                    continue
                yield parse(rest + chunk[:cut])
                rest = chunk[cut:]
    except OSError as error:
        raise RefusedError(str(path), f"cannot be read: {error.strerror}") from error
