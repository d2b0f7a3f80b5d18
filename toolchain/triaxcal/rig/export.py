"""`triaxcal rig export`: the evidence log in the formats of other tools."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import can
import numpy as np

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.rig.canbus import messages_of
from triaxcal.rig.candump import NS_PER_US, read_log
from triaxcal.rig.export_columns import mf4_writer, parquet_writer
from triaxcal.rig.frames import ID_MASK, Frames

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
    with target.open("w", encoding="ascii", newline="\n") as file:
        file.write("time_s,id,extended,remote,error,fd,length,payload\n")

        def put(frames: Frames) -> None:
            table = np.stack([*frames.flags, frames.fd, frames.length], axis=1).astype(np.int64)
            rows = zip(
                (frames.t_ns // NS_PER_US).tolist(),
                (frames.can_id & np.uint32(ID_MASK)).tolist(),
                table.tolist(),
                frames.data,
                strict=True,
            )
            for t_us, can_id, (extended, remote, error, fd, length), data in rows:
                file.write(
                    f"{t_us // 10**6}.{t_us % 10**6:06d},0x{can_id:X},{extended},{remote},{error},"
                    f"{fd},{length},{data[:length].tobytes().hex().upper()}\n"
                )

        yield put


WRITERS: dict[str, Callable[[Path], AbstractContextManager[Put]]] = {
    ".asc": _python_can,
    ".blf": _python_can,
    ".csv": _csv,
    ".mf4": mf4_writer,
    ".parquet": parquet_writer,
}
"""By suffix of the target."""


def export_log(log: Path, target: Path, written: Callable[[int], None]) -> int:
    """Write a log in another format, by the target's suffix; returns the number of frames.

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
    count = 0
    # python-can and asammdf choose the format by the suffix: it stays at the end.
    aside = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        try:
            aside.touch()  # says in the system's words why it cannot be
            with WRITERS[target.suffix](aside) as put:
                for parsed in read_log(log):
                    put(parsed.frames)
                    count += len(parsed.frames)
                    written(count)
            if not count:
                raise RefusedError(str(log), "no frames in it", expected="a candump log")
            aside.replace(target)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        raise refused_by_system(target, "written", error) from error
    return count
