"""Whose recording a file is, where a column or a line above the table says it."""

from __future__ import annotations

from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.readings.opened import RecordingFile
from triaxcal.unit.recordingfile import FileLayout

_NAMES = frozenset({
    "serial", "serial_number", "serialnumber", "serial_no", "sn", "s/n", "unit_serial", "device_id",
})  # fmt: skip


def serial_column(names: tuple[str, ...]) -> int | None:
    """Index of the column with serial numbers; None where there is none, or several."""
    found = [
        k for k, name in enumerate(names) if name.strip().casefold().replace(" ", "_") in _NAMES
    ]
    return found[0] if len(found) == 1 else None


def refuse_other_serial(path: Path, layout: FileLayout, serial: str) -> None:
    """Refuse a recording whose column of serial numbers names another unit.

    Raises
    ------
    RefusedError
        Names the column and the serial number in it.
    """
    file = RecordingFile(path, layout)
    column = serial_column(file.source.names)
    if column is None:
        return
    for block in file.blocks([], [column]):
        others = {text.strip() for text in block.texts[0]} - {"", serial}
        if others:
            raise RefusedError(
                f"{path}, column {file.source.names[column]}",
                f"serial number {min(others)!r}",
                expected=f"{serial!r}, the unit's",
                remedy="give a recording of this unit, or name the other unit",
            )
