"""Text of candump; also what nothing else takes."""

from __future__ import annotations

from triaxcal.rig.logs.candump import read_log
from triaxcal.rig.logs.logfile import LogFormat

ENTRY = LogFormat(
    name="candump",
    label="text of candump",
    doc="Log files of `candump -l`, what `candump can0` shows, and what python-can writes; text "
    "with a byte order mark or of wide characters as well.",
    takes=lambda name, head: True,  # noqa: ARG005
    read=read_log,
    unpacks=True,
    rank=900,
)
