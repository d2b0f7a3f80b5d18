"""Arrays of NumPy: .npy, read in pieces, and .npz."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source
from triaxcal.unit.recordingfile import FileLayout


def _open(path: Path, layout: FileLayout) -> Source:
    with path.open("rb") as file:
        if not file.read(2).startswith(b"PK"):
            array = np.load(path, mmap_mode="r", allow_pickle=False)
            return ArraySource(str(path), {"": array}, layout)
        file.seek(0)
        loaded = np.load(file, allow_pickle=False)
        return ArraySource(str(path), {k: v for k, v in loaded.items() if v.ndim}, layout)


ENTRY = Format(
    name="numpy",
    label="NumPy",
    doc="A column of .npy is a number from 1, or the name of a field. A column of .npz is the name "
    "of an array, as ax, or a column of it, as acc[0]; its arrays are loaded whole.",
    open=_open,
    extensions=(".npy", ".npz"),
    sniff=lambda head: (
        head.startswith(b"\x93NUMPY")
        or (head.startswith(b"PK\x03\x04") and b".npy" in head[30:200])
    ),
    package="numpy",
)
