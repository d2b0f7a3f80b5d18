"""Readings of an orthogonal pair at the positions of a dividing head."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.readings.text import read_text
from triaxcal.unit.recording import POSES, RecordingLayout, SignedColumn

COLUMNS = ("theta_deg", "a_g", "b_g")


def read_pair(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles in rad and readings A, B in g, each (n,), of a CSV with columns `COLUMNS`.

    Raises
    ------
    RefusedError
        When the file cannot be read, lacks a column, or holds something else than numbers.
    """
    layout = RecordingLayout(
        file=path.name,
        rows=POSES,
        acceleration=tuple(SignedColumn(name, 1) for name in COLUMNS),
        acceleration_unit="g",
    )
    text = read_text(path, layout)
    theta, a, b = (text.numbers(text.index(name, name), missing=False) for name in COLUMNS)
    return np.radians(theta), a, b
