"""MAT-files of MATLAB 5 to 7.2: one matrix by column numbers, or vectors by name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout

_WIDE = 4
"""Columns a row: three axes of the fewest samples that carry a calibration, 12, are as wide."""


def _open(path: Path, layout: FileLayout) -> Source:
    from scipy.io import loadmat  # noqa: PLC0415  slow to import

    loaded = loadmat(path, squeeze_me=True, struct_as_record=False)
    found = {name: value for name, value in loaded.items() if not name.startswith("__")}
    arrays = _arrays(found)
    turned = [name for name, value in arrays.items() if is_turned(value.shape, layout)]
    source = ArraySource(
        str(path), {n: v.T if n in turned else v for n, v in arrays.items()}, layout
    )
    source.findings = told(turned)
    return source


def is_turned(shape: Sequence[int], layout: FileLayout) -> bool:
    """Whether the samples of a matrix run along its rows: it is far wider than long.

    A matrix that would then lack a column that is asked for is taken as it is.
    """
    places = (re.fullmatch(r"(?:.*\[)?(\d+)(\])?", str(column)) for column in layout.wanted)
    # Columns are counted from 1, places in brackets from 0.
    last = max((int(found[1]) + bool(found[2]) for found in places if found), default=0)
    return len(shape) == 2 and shape[1] >= _WIDE * shape[0] and last <= shape[0]


def told(turned: Sequence[str]) -> tuple[str, ...]:
    """What is reported of matrices that were turned."""
    return tuple(f"{name}: wider than long, so its rows are taken as columns" for name in turned)


def _arrays(found: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Numeric arrays; fields of a structure as structure.field."""
    result: dict[str, Any] = {}
    for name, value in found.items():
        if hasattr(value, "_fieldnames"):
            fields = {field: getattr(value, field) for field in value._fieldnames}
            result |= _arrays(fields, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim in (1, 2):
            result[prefix + name] = value
    return result


ENTRY = Format(
    name="mat",
    label="a MAT-file",
    doc="A column is a vector by its name, as imu.ax for a field of a structure, or of a matrix, "
    "as acc[0]; of one matrix, a number from 1. A matrix four times wider than long is turned. "
    "Loaded whole.",
    open=_open,
    extensions=(".mat",),
    sniff=starts_with(b"MATLAB"),
    package="scipy",
)
