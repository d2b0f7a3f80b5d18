"""The evidence log: text of candump, written and read many lines at a time.

(1620692699.796900) can0 100#52010A0B0C0D0E0F     classic
(1620692699.796900) can0 110##1<hex>              CAN FD, one digit of flags: 1 BRS, 2 ESI
(1620692699.796900) can0 100#R8                   remote request, of eight bytes
(1620692699.796900) can0 100#0011223344556677_9   classic, data length code 9
(1620692699.796900) can0 20000040#0000000000000000  error frame
(1620692699.796900) can0 100#00 T                 sent by the computer that took it down

That is what is written; `columns` here reads it. What else candump, python-can and people make of
it, `candump_lines` reads line by line.

A line is taken whole or not at all: a last line without its end is torn and left out, a line with
one wrong character is left out; both are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import (
    BRS,
    DLC_SHIFT,
    EFF_FLAG,
    ERR_FLAG,
    ESI,
    FD_LENGTHS,
    ID_MASK,
    RTR_FLAG,
    SENT,
    BoolArray,
    ByteArray,
    Frames,
    concatenate,
    empty,
)
from triaxcal.rig.logs.candump_lines import frames_of_lines, shown_line
from triaxcal.rig.logs.textlog import whole_lines

NS_PER_US = 1000
_DIGITS = 10  # of whole seconds: from 2001 to 2286
_LAST_S = 9_223_372_035
_CHUNK_BYTES = 4 << 20
_NO_MARKS = np.zeros(0, np.uint8)

_HEX = np.full(256, 255, np.uint8)
for _value, _char in enumerate(b"0123456789ABCDEF"):
    _HEX[_char] = _value
for _value, _char in enumerate(b"abcdef", start=10):
    _HEX[_char] = _value


@dataclass(frozen=True)
class Parsed:
    """Frames of a text.

    Attributes
    ----------
    lines : int
        Whole lines.
    bad_lines : int
        Those of them that are no frame; an incomplete last line is one, and none of `lines`.
    untimed : int
        Frames without a time; they have 0.
    first_bad : str
        The first line that is no frame.
    cut : str
        What the file lacks at its end; "" for nothing.
    """

    frames: Frames
    lines: int
    bad_lines: int
    untimed: int = 0
    first_bad: str = ""
    cut: str = ""


Parse = Callable[[bytes], Parsed]
"""Frames of the whole lines of a text."""


def format_frames(frames: Frames, channel: str) -> bytes:
    """Lines of frames; times are cut to whole microseconds.

    `channel` is the name of those frames that have none. A name is one word of ASCII there.
    """
    hexes = frames.data.tobytes().hex().upper()
    wide = 2 * frames.data.shape[1]
    names = {name: _word(name.decode("ascii", "replace") or channel) for name in
             np.unique(frames.channel).tolist()}  # fmt: skip
    lines = []
    columns = zip(
        (frames.t_ns // NS_PER_US).tolist(),
        frames.can_id.tolist(),
        frames.length.tolist(),
        frames.fd.tolist(),
        frames.marks.tolist(),
        frames.channel.tolist(),
        strict=True,
    )
    for i, (t_us, can_id, length, fd, marks, name) in enumerate(columns):
        if can_id & ERR_FLAG:
            number = f"{can_id & (ID_MASK | ERR_FLAG):08X}"
        elif can_id & EFF_FLAG:
            number = f"{can_id & ID_MASK:08X}"
        else:
            number = f"{can_id & 0x7FF:03X}"
        body = hexes[i * wide : i * wide + 2 * length]
        if can_id & RTR_FLAG:
            body = f"R{length}" if length else "R"
        if marks >> DLC_SHIFT:
            body += f"_{marks >> DLC_SHIFT:X}"
        mark = f"##{marks & (BRS | ESI)}" if fd else "#"
        tail = " T" if marks & SENT else ""
        stamp = f"{t_us // 10**6}.{t_us % 10**6:06d}"
        lines.append(f"({stamp}) {names[name]} {number}{mark}{body}{tail}\n")
    return "".join(lines).encode("ascii")


def _word(name: str) -> str:
    """A name as one word of ASCII."""
    return "_".join(name.encode("ascii", "replace").decode().split()) or "can"


def parse(text: bytes) -> Parsed:
    """Frames of candump text, in its order; what follows the last newline is left out."""
    buffer = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(buffer == ord("\n"))
    if not len(ends):
        return Parsed(empty(), 0, 0)
    starts = np.concatenate([[0], ends[:-1] + 1])
    stops, sent = _stops(buffer, starts, ends)
    parts, places = [], []
    for frames, rows in _columns(buffer, starts, stops):
        marks = frames.marks | np.where(sent[rows], SENT, 0).astype(np.uint8)
        parts.append(replace(frames, marks=marks))
        places.append(rows)
    left = np.ones(len(ends), np.bool_)
    for rows in places:
        left[rows] = False
    others = np.flatnonzero(left)
    lines = [text[starts[i] : ends[i]] for i in others.tolist()]
    found = frames_of_lines(lines)
    parts.append(found.frames)
    places.append(others[found.rows])
    order = np.argsort(np.concatenate(places), kind="stable")
    return Parsed(
        concatenate(parts).take(order),
        len(ends),
        len(ends) - len(order),
        found.untimed,
        found.first_bad,
    )


def _stops(buffer: ByteArray, starts: IntArray, ends: IntArray) -> tuple[IntArray, BoolArray]:
    """Ends of the lines without a carriage return and a direction; which were sent."""
    stops = ends - ((ends > starts) & (buffer[ends - 1] == ord("\r")))
    at = np.maximum(stops - 2, starts)
    spaced = (stops - 2 > starts) & (buffer[at] == ord(" "))
    last = buffer[np.maximum(stops - 1, 0)]
    sent = spaced & (last == ord("T"))
    return np.where(sent | (spaced & (last == ord("R"))), stops - 2, stops), sent


def _columns(
    buffer: ByteArray, starts: IntArray, ends: IntArray
) -> Iterator[tuple[Frames, IntArray]]:
    """Frames of the lines that are written as `format_frames` does, and which lines they are."""
    hashes = np.flatnonzero(buffer == ord("#"))
    if not len(hashes):
        return
    first = hashes[np.minimum(np.searchsorted(hashes, starts), len(hashes) - 1)]
    relative = first - starts
    length = ends - starts
    relative[(relative < 0) | (relative >= length)] = 0  # no '#' in this line
    keys = length * 4096 + np.minimum(relative, 4095)
    left = np.arange(len(keys))
    while len(left):  # a log has lines of a few forms
        key = int(keys[left[0]])
        alike = keys[left] == key
        rows, left = left[alike], left[~alike]
        for frames, kept in _parse_alike(buffer, starts[rows], key // 4096, key % 4096):
            yield frames, rows[kept]


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
    good &= s_ok & u_ok & (seconds <= _LAST_S)
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
            chosen = rows[ok & (is_fd == fd)]
            if not len(chosen) or payload_at > length:
                continue
            data, good_hex = _payload(text[chosen, payload_at:], fd)
            kept = chosen[good_hex]
            size = (length - payload_at) // 2
            names = np.ascontiguousarray(text[kept, name_end:before])
            yield (
                Frames(
                    t_ns[kept],
                    can_id[ok & (is_fd == fd)][good_hex].astype(np.uint32),
                    np.full(len(kept), size, np.uint8),
                    np.full(len(kept), fd, np.bool_),
                    data,
                    _HEX[text[kept, mark + 2]] & np.uint8(BRS | ESI) if fd else _NO_MARKS,
                    names.view(f"S{before - name_end}")[:, 0],
                ),
                kept,
            )


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


def _payload(text: ByteArray, fd: bool) -> tuple[ByteArray, IntArray]:
    """Payloads (m, 8) or (m, 64) of text (n, characters), and which m of the n are good."""
    size, width = text.shape[1] // 2, 64 if fd else 8
    if text.shape[1] % 2 or size > width or (fd and size not in FD_LENGTHS):
        return np.zeros((0, width), np.uint8), np.zeros(0, np.int64)
    nibbles = _HEX[text]
    good = _each_row(nibbles < 16)
    ok = np.flatnonzero(good)
    nibbles = nibbles if len(ok) == len(good) else nibbles[ok]
    data = np.zeros((len(ok), width), np.uint8)
    data[:, :size] = (nibbles[:, 0::2] << np.uint8(4)) | nibbles[:, 1::2]
    return data, ok


def read_log(
    path: Path, start: int = 0, end: int | None = None, parse: Parse = parse
) -> Generator[Parsed, None, None]:
    """Frames of a log, a piece of whole lines at a time; it may be compressed by gzip.

    Parameters
    ----------
    start, end : int
        Bytes of the file to read; `end` None is its end.
    parse : callable
        Frames of whole lines; those of candump text by default.

    Raises
    ------
    RefusedError
        When the file cannot be read.
    """
    for text in whole_lines(path, start, end, _CHUNK_BYTES):
        if text.endswith(b"\n"):
            yield parse(text)
        else:
            yield Parsed(empty(), 0, 1, first_bad=shown_line(text))
