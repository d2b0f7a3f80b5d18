"""`triaxcal rig export`: the evidence log in the formats of other tools."""

from __future__ import annotations

from pathlib import Path

import can

from triaxcal.errors import RefusedError
from triaxcal.rig.candump import read_log
from triaxcal.rig.sources import messages_of

SUFFIXES = (".asc", ".blf", ".csv")


def export_log(log: Path, target: Path) -> int:
    """Write a log as ASC, BLF or CSV, by the target's suffix; returns the number of frames.

    Raises
    ------
    RefusedError
        When the suffix is another, a file cannot be read or written.
    """
    if target.suffix not in SUFFIXES:
        raise RefusedError(
            str(target), f"suffix {target.suffix!r}", expected="one of " + ", ".join(SUFFIXES)
        )
    count = 0
    try:
        with can.Logger(str(target)) as writer:
            for parsed in read_log(log):
                for message in messages_of(parsed.frames):
                    writer.on_message_received(message)
                count += len(parsed.frames)
    except OSError as error:
        raise RefusedError(str(target), f"cannot be written: {error.strerror}") from error
    return count
