"""Readings of an orthogonal pair at the positions of a dividing head."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.readings.opened import RecordingFile
from triaxcal.unit.recordingfile import FileLayout

COLUMNS = ("theta_deg", "a_g", "b_g")


def read_pair(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles in rad and readings A, B in g, each (n,), of a file with columns `COLUMNS`.

    Raises
    ------
    RefusedError
        When the file cannot be read, lacks a column, or holds something else than numbers.
    """
    file = RecordingFile(path, FileLayout("recording", COLUMNS))
    parts = []
    for block in file.blocks([file.index(name, name) for name in COLUMNS]):
        empty = np.argwhere(np.isnan(block.numbers))
        if len(empty):
            row, column = empty[0]
            raise RefusedError(
                f"{path}, {file.source.row_word} {block.rows[row]}, column {COLUMNS[column]}",
                "the cell is empty",
                expected="a number",
            )
        parts.append(block.numbers)
    theta, a, b = np.concatenate(parts).T.copy()
    return np.radians(theta), a, b
