"""Lines of candump in every form of the field, one at a time.

- stamps of zero to nine digits before or after the point, with a date (taken as UTC), or none;
- `#R`, `#R8`, `_9` to `_F` behind eight bytes, dots between bytes, ` R` and ` T` at the end;
- the screen of `candump can0`: `can0  123   [8]  11 22 33 44 55 66 77 88`, with the direction and
  flags of `-x`, `[08]` of CAN FD, `remote request`, ERRORFRAME, the text of `-a`, colours.

Sources: lib.c and candump.c of can-utils (parse_canframe, snprintf_long_canframe).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

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
    Frames,
    empty,
)

_LAST_NS = 2**63 - 1
_STAMP = rb"""
    (?:\((?:(?P<date>\d{4}-\d\d-\d\d)[ ](?P<time>\d\d:\d\d:\d\d)|(?P<whole>\d{0,10}))
    (?:\.(?P<part>\d{0,9}))?\)\s+)?
    (?P<name>[^\s()#]+)\s+
"""
_ID = rb"(?P<id>[0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})"
_LOGGED = re.compile(
    rb"\s*"
    + _STAMP
    + _ID
    + rb"""\#
    (?:\#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2}\.?)*)
    |(?:R(?P<asked>[0-8])?|(?P<data>(?:[0-9A-Fa-f]{2}\.?){0,8}))(?:_(?P<code>[9A-Fa-f]))?)
    (?:\s+(?P<way>[RT]))?\s*""",
    re.VERBOSE,
)
_SHOWN = re.compile(
    rb"\s*"
    + _STAMP
    + rb"(?:(?P<way>[RT])X\s+(?P<brs>[B-])\s(?P<esi>[E-])\s+)?"
    + _ID
    + rb"""
    \s+(?:\[(?P<size>\d{1,2})\]|\{(?P<code>[0-9A-F])\})
    (?:\s+(?P<asked>remote\ request)|(?P<data>(?:\s+[0-9A-F]{2})*))
    (?:\s+ERRORFRAME|\s+'.*')?\s*""",
    re.VERBOSE,
)
_COLOUR = re.compile(rb"\x1b\[[0-9;]*m")
_SHOWN_CHARACTERS = 60


@dataclass(frozen=True)
class Found:
    """Frames of some lines, which lines they are, and the first line that is none.

    `untimed` counts frames without a time; they have 0.
    """

    frames: Frames
    rows: IntArray
    untimed: int
    first_bad: str


@dataclass(frozen=True)
class Frame:
    """One frame, as the columns of `Frames`; without a time its `t_ns` is None."""

    t_ns: int | None
    can_id: int
    length: int
    fd: bool
    data: bytes
    marks: int
    channel: bytes


def frames_of_lines(lines: Sequence[bytes]) -> Found:
    """Frames of lines."""
    found: list[Frame] = []
    rows: list[int] = []
    first_bad = ""
    for row, line in enumerate(lines):
        frame = _frame(line)
        if frame is None:
            first_bad = first_bad or shown_line(line)
            continue
        found.append(frame)
        rows.append(row)
    untimed = sum(frame.t_ns is None for frame in found)
    return Found(frames_of_rows(found), np.array(rows, np.int64), untimed, first_bad)


def shown_line(line: bytes) -> str:
    """A line for a message."""
    text = line[: 4 * _SHOWN_CHARACTERS].decode("ascii", "replace").strip()
    text = "".join(c if c.isprintable() else "?" for c in text)
    return repr(text if len(text) <= _SHOWN_CHARACTERS else text[:_SHOWN_CHARACTERS] + "...")


def frames_of_rows(found: Sequence[Frame]) -> Frames:
    """Frames of single ones."""
    if not found:
        return empty()
    width = 64 if any(frame.fd for frame in found) else 8
    payload = b"".join(frame.data.ljust(width, b"\0") for frame in found)
    return Frames(
        np.array([frame.t_ns or 0 for frame in found], np.int64),
        np.array([frame.can_id for frame in found], np.uint32),
        np.array([frame.length for frame in found], np.uint8),
        np.array([frame.fd for frame in found], np.bool_),
        np.frombuffer(payload, np.uint8).reshape(len(found), width),
        np.array([frame.marks for frame in found], np.uint8),
        np.array([frame.channel for frame in found], np.bytes_),
    )


def _frame(line: bytes) -> Frame | None:
    """Frame of a line; None where it is none."""
    if b"\x1b" in line:
        line = _COLOUR.sub(b"", line)
    logged = _LOGGED.fullmatch(line)
    match = logged or _SHOWN.fullmatch(line)
    if match is None:
        return None
    can_id, t_ns = _identifier(match["id"]), _time(match)
    body = _logged(match) if logged else _shown(match)
    if can_id is None or body is None or (t_ns is not None and t_ns > _LAST_NS):
        return None
    fd, data, marks, asked = body
    if asked is not None:
        can_id |= RTR_FLAG
    if match["way"] == b"T":
        marks |= SENT
    length = len(data) if asked is None else asked
    return Frame(t_ns, can_id, length, fd, data, marks, match["name"])


Body = tuple[bool, bytes, int, int | None]
"""CAN FD, payload, marks, and the bytes that a remote request asks for."""


def _logged(match: re.Match[bytes]) -> Body | None:
    code = int(match["code"], 16) << DLC_SHIFT if match["code"] else 0
    if match["flags"]:
        data = _bytes(match["fd"])
        marks = int(match["flags"], 16) & (BRS | ESI)
        return (True, data, marks, None) if len(data) in FD_LENGTHS else None
    if match["data"] is None:
        asked = int(match["asked"] or 0)
        return None if code and asked != 8 else (False, b"", code, asked)
    data = _bytes(match["data"])
    return None if code and len(data) != 8 else (False, data, code, None)


def _shown(match: re.Match[bytes]) -> Body | None:
    code = int(match["code"], 16) if match["code"] else int(match["size"])
    fd = match["size"] is not None and len(match["size"]) == 2
    size, code = (8, code << DLC_SHIFT) if not fd and code > 8 else (code, 0)
    marks = (BRS if match["brs"] == b"B" else 0) | (ESI if match["esi"] == b"E" else 0) | code
    if match["asked"]:
        return False, b"", marks, size
    data = _bytes(match["data"])
    good = len(data) == size and (size in FD_LENGTHS if fd else size <= 8)
    return (fd, data, marks, None) if good else None


def _bytes(text: bytes) -> bytes:
    return bytes.fromhex(text.replace(b".", b"").decode())


def _identifier(text: bytes) -> int | None:
    value = int(text, 16)
    if len(text) == 3:
        return value if value <= 0x7FF else None
    if value > ERR_FLAG | ID_MASK:
        return None
    return value if value & ERR_FLAG else value | EFF_FLAG


def _time(match: re.Match[bytes]) -> int | None:
    """Time in ns; None where the line has none."""
    part = match["part"] or b""
    if match["date"]:
        text = f"{match['date'].decode()} {match['time'].decode()}"
        try:
            moment = datetime.strptime(text, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
        except ValueError:
            return None
        whole = int(moment.timestamp())
    elif match["whole"] or part:
        whole = int(match["whole"] or 0)
    else:
        return None
    return whole * 10**9 + int(part.ljust(9, b"0"))
