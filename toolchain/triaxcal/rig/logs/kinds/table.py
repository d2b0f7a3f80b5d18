"""Tables of frames: what `triaxcal rig export` writes as CSV, and what python-can does."""

from __future__ import annotations

import csv
from base64 import b64decode
from collections.abc import Callable, Generator, Mapping, Sequence
from itertools import islice
from pathlib import Path

from triaxcal.rig.bus.frames import BRS, DLC_SHIFT, EFF_FLAG, ERR_FLAG, ESI, RTR_FLAG, SENT
from triaxcal.rig.logs.candump import Parsed
from triaxcal.rig.logs.candump_lines import Frame, frames_of_rows, shown_line
from triaxcal.rig.logs.logfile import LogFormat

_PIECE = 1 << 15
_FLAGS = (("extended", EFF_FLAG), ("remote", RTR_FLAG), ("error", ERR_FLAG))
_MARKS = (("brs", BRS), ("esi", ESI), ("sent", SENT))

Row = Mapping[str, str]


def _read(path: Path) -> Generator[Parsed, None, None]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        rows = csv.DictReader(file)
        frame_of = _DIALECTS[(rows.fieldnames or ("",))[0]]
        while piece := list(islice(rows, _PIECE)):
            yield _parsed(piece, frame_of)


def _parsed(rows: Sequence[Row], frame_of: Callable[[Row], Frame]) -> Parsed:
    found: list[Frame] = []
    first_bad = ""
    frame: Frame | None
    for row in rows:
        try:
            frame = frame_of(row)
        except (ValueError, TypeError, KeyError, AttributeError):
            frame = None
        if frame is not None and _is_whole(frame):
            found.append(frame)
        else:
            first_bad = first_bad or shown_line(",".join(map(str, row.values())).encode())
    bad = len(rows) - len(found)
    return Parsed(frames_of_rows(found), len(rows), bad, first_bad=first_bad)


def _ours(row: Row) -> Frame:
    return Frame(
        t_ns=_nanoseconds(row["time_s"]),
        can_id=int(row["id"], 16) | _bits(row, _FLAGS),
        length=int(row["length"]),
        fd=row["fd"] == "1",
        data=bytes.fromhex(row["payload"]),
        # Tables of version 0.1.0 have no more columns.
        marks=_bits(row, _MARKS) | int(row.get("dlc") or 0) << DLC_SHIFT,
        channel=(row.get("channel") or "").encode(),
    )


def _python_cans(row: Row) -> Frame:
    data = b64decode(row["data"], validate=True)
    return Frame(
        t_ns=round(float(row["timestamp"]) * 1e6) * 1000,  # a float, good to a microsecond
        can_id=int(row["arbitration_id"], 16) | _bits(row, _FLAGS),
        length=int(row["dlc"]),
        fd=len(data) > 8,  # it has no column for this
        data=data,
        marks=0,
        channel=b"",
    )


def _is_whole(frame: Frame) -> bool:
    """Whether a frame has its payload: one of a torn row has less."""
    return bool(frame.can_id & RTR_FLAG) or frame.length == len(frame.data)


def _bits(row: Row, names: Sequence[tuple[str, int]]) -> int:
    return sum(bit for name, bit in names if row.get(name) == "1")


def _nanoseconds(text: str) -> int:
    whole, _, part = text.partition(".")
    return int(whole) * 10**9 + int(part.ljust(9, "0")[:9])


_DIALECTS = {"time_s": _ours, "timestamp": _python_cans}


def _takes(name: str, head: bytes) -> bool:
    first = head.removeprefix(b"\xef\xbb\xbf").split(b",")[0].decode("ascii", "replace")
    return name.endswith(".csv") and first in _DIALECTS


ENTRY = LogFormat(
    name="table",
    label="a table of frames",
    doc="CSV of `triaxcal rig export`, and of python-can, which has no CAN FD flag: frames of more "
    "than eight bytes are CAN FD.",
    takes=_takes,
    read=_read,
    rank=10,
)
