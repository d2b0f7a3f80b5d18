"""Readings of an orthogonal pair at the positions of a dividing head."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.readings.opened import RecordingFile
from triaxcal.unit.recordingfile import FileLayout

COLUMNS = ("theta_deg", "a_g", "b_g")


SD_COLUMNS = ("sd_a_g", "sd_b_g")


@dataclass(frozen=True)
class PairReadings:
    """Positions of the head, and what the pair read there.

    Attributes
    ----------
    theta_rad, a_g, b_g : arrays, shape (n,)
    sd_g : array, shape (n, 2), or None
        Standard deviations of A and B.
    """

    theta_rad: FloatArray
    a_g: FloatArray
    b_g: FloatArray
    sd_g: FloatArray | None


def read_pair(path: Path) -> PairReadings:
    """Readings in a file with columns `COLUMNS`, and `SD_COLUMNS` if it has them.

    Raises
    ------
    RefusedError
        When the file cannot be read, lacks a column, or holds something else than numbers.
    """
    file = RecordingFile(path, FileLayout("recording", COLUMNS))
    there = [name for name in SD_COLUMNS if name in file.source.names]
    if len(there) == 1:
        raise RefusedError(
            f"{path}, column {there[0]}",
            "the standard deviation of one accelerometer alone",
            expected=" and ".join(SD_COLUMNS),
            remedy="add the other column, or remove this one",
        )
    stated = bool(there)
    names = (*COLUMNS, *SD_COLUMNS) if stated else COLUMNS
    parts = []
    for block in file.blocks([file.index(name, name) for name in names]):
        wrong = np.isnan(block.numbers)
        if stated:
            wrong[:, 3:] |= ~(block.numbers[:, 3:] > 0.0)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            empty = np.isnan(block.numbers[row, column])
            raise RefusedError(
                f"{path}, {file.source.row_word} {block.rows[row]}, column {names[column]}",
                "the cell is empty" if empty else f"{block.numbers[row, column]:g}",
                expected="a number" if column < len(COLUMNS) else "a number above 0",
            )
        parts.append(block.numbers)
    numbers = np.concatenate(parts)
    theta, a, b = numbers[:, :3].T.copy()
    return PairReadings(np.radians(theta), a, b, numbers[:, 3:].copy() if stated else None)
