"""MAT-files of MATLAB 5 to 7.2: one matrix by column numbers, or vectors by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout


def _open(path: Path, layout: FileLayout) -> Source:
    from scipy.io import loadmat  # noqa: PLC0415  slow to import

    loaded = loadmat(path, squeeze_me=True, struct_as_record=False)
    found = {name: value for name, value in loaded.items() if not name.startswith("__")}
    return ArraySource(str(path), _arrays(found), layout)


def _arrays(found: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Numeric arrays; fields of a structure as structure.field."""
    result: dict[str, Any] = {}
    for name, value in found.items():
        if hasattr(value, "_fieldnames"):
            fields = {field: getattr(value, field) for field in value._fieldnames}
            result |= _arrays(fields, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim in (1, 2):
            # Samples run down; a matrix with more columns than rows is turned.
            turned = value.ndim == 2 and value.shape[0] < value.shape[1]
            result[prefix + name] = value.T if turned else value
    return result


ENTRY = Format(
    name="mat",
    label="a MAT-file",
    doc="A column is a vector by its name, as imu.ax for a field of a structure, or of a matrix, "
    "as acc[0]; of one matrix, a number from 1. Loaded whole.",
    open=_open,
    extensions=(".mat",),
    sniff=starts_with(b"MATLAB"),
    package="scipy",
)
