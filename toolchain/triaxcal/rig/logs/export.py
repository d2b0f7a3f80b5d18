"""`triaxcal rig export`: the evidence log in the formats of other tools."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import can
import numpy as np

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.rig.bus.frames import BRS, DLC_SHIFT, ESI, ID_MASK, SENT, Frames
from triaxcal.rig.bus.messages import messages_of
from triaxcal.rig.logs.candump import format_frames
from triaxcal.rig.logs.export_columns import mf4_writer, parquet_writer
from triaxcal.rig.logs.logfile import Left, read_frames

COLUMNS = (
    "time_s", "id", "extended", "remote", "error", "fd", "length", "payload",
    "brs", "esi", "sent", "dlc", "channel",
)  # fmt: skip
"""Of the CSV; the first eight since version 0.1.0."""
Put = Callable[[Frames], None]
"""Adds frames to a file that is being written."""


@contextmanager
def _python_can(target: Path) -> Iterator[Put]:
    with can.Logger(str(target)) as writer:

        def put(frames: Frames) -> None:
            for message in messages_of(frames):
                writer.on_message_received(message)

        yield put


@contextmanager
def _csv(target: Path) -> Iterator[Put]:
    """Open a table, one row a frame; python-can's has no CAN FD flag and payloads in base64."""
    with target.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(COLUMNS) + "\n")

        def put(frames: Frames) -> None:
            marks = [(frames.marks & bit) != 0 for bit in (BRS, ESI, SENT)]
            flags = np.stack([*frames.flags, frames.fd, *marks], axis=1).astype(np.int64)
            rows = zip(
                frames.t_ns.tolist(),
                (frames.can_id & np.uint32(ID_MASK)).tolist(),
                flags.tolist(),
                frames.length.tolist(),
                frames.data,
                (frames.marks >> DLC_SHIFT).tolist(),
                frames.channel.tolist(),
                strict=True,
            )
            for t_ns, can_id, (ext, rtr, err, fd, brs, esi, sent), length, data, dlc, name in rows:
                payload = "" if rtr else data[:length].tobytes().hex().upper()
                file.write(
                    f"{t_ns // 10**9}.{t_ns % 10**9:09d},0x{can_id:X},{ext},{rtr},{err},{fd},"
                    f"{length},{payload},{brs},{esi},{sent},{dlc or ''},"
                    f"{name.decode('utf-8', 'replace').replace(',', '_')}\n"
                )

        yield put


@contextmanager
def _candump(target: Path) -> Iterator[Put]:
    with target.open("wb") as file:

        def put(frames: Frames) -> None:
            file.write(format_frames(frames, "can0"))

        yield put


WRITERS: dict[str, Callable[[Path], AbstractContextManager[Put]]] = {
    ".asc": _python_can,
    ".blf": _python_can,
    ".csv": _csv,
    ".log": _candump,
    ".mf4": mf4_writer,
    ".parquet": parquet_writer,
}
"""By suffix of the target."""


def export_log(log: Path, target: Path, written: Callable[[int], None]) -> tuple[int, list[str]]:
    """Write a log in another format, by the target's suffix.

    Returns the number of frames, and what of the log could not be used.

    Parameters
    ----------
    written : callable
        Gets the number of frames done, now and then.

    Raises
    ------
    RefusedError
        When the suffix is another, a package is missing, the log cannot be read or holds no
        frames, or the target cannot be written. Nothing is left half-written.
    """
    if target.suffix not in WRITERS:
        raise RefusedError(
            str(target), f"suffix {target.suffix!r}", expected="one of " + ", ".join(WRITERS)
        )
    count, left = 0, Left()
    # python-can and asammdf choose the format by the suffix: it stays at the end.
    aside = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        try:
            aside.touch()  # says in the system's words why it cannot be
            with WRITERS[target.suffix](aside) as put:
                for parsed in read_frames(log):
                    put(parsed.frames)
                    left.add(parsed)
                    count += len(parsed.frames)
                    written(count)
            if not count:
                first = f"; its first line is {left.first}" if left.first else ""
                raise RefusedError(
                    str(log), f"no frames in it{first}", expected="a log of CAN frames"
                )
            aside.replace(target)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        raise refused_by_system(target, "written", error) from error
    return count, left.notes(log)
