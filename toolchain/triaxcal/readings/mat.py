"""MAT-files of MATLAB 5 to 7.2: one matrix by column numbers, or vectors by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.types import FloatArray
from triaxcal.unit.recording import Column

_HDF5 = b"\x89HDF"


def is_mat_file(path: Path) -> bool:
    """Whether a file is MATLAB's: by what it holds, for text is named .mat too."""
    try:
        with path.open("rb") as file:
            start = file.read(128)
    except OSError:
        return False  # the reader of text tells it
    return start.startswith((b"MATLAB", _HDF5))


class MatTable:
    """Columns of a MAT-file."""

    def __init__(self, path: Path, variable: str | None) -> None:
        self.source = str(path)
        if path.read_bytes()[:4] == _HDF5 or b"MATLAB 7.3" in path.read_bytes()[:128]:
            raise RefusedError(
                self.source,
                "a MAT-file of version 7.3",
                expected="version 5 to 7.2",
                remedy="save it in MATLAB with save(..., '-v7')",
            )
        try:
            loaded = loadmat(path, squeeze_me=True, struct_as_record=False)
        except Exception as error:  # scipy raises whatever its parser meets
            raise RefusedError(self.source, f"not a MAT-file: {error}") from error
        self.vectors = _vectors({k: v for k, v in loaded.items() if not k.startswith("__")})
        self.matrix = self._matrix(variable)

    def _matrix(self, variable: str | None) -> FloatArray | None:
        matrices = {k: v for k, v in self.vectors.items() if v.ndim == 2}
        if variable is None:
            return next(iter(matrices.values())) if len(matrices) == 1 else None
        if variable not in matrices:
            raise RefusedError(
                self.source,
                f"no matrix {shown(variable)}{did_you_mean(variable, matrices)}",
                expected="one of " + ", ".join(matrices) if matrices else "a matrix",
            )
        return matrices[variable]

    def numbers(self, column: Column, key: str) -> FloatArray:
        """Values of a column by number, or of a vector by name, shape (n,)."""
        if isinstance(column, int):
            if self.matrix is None:
                raise RefusedError(
                    self.source,
                    f"holds {', '.join(self.vectors) or 'no numbers'}",
                    expected=f"one matrix for column {column} ([recording] {key})",
                    remedy='name it: variable = "..."',
                )
            if column > self.matrix.shape[1]:
                raise RefusedError(
                    self.source,
                    f"{self.matrix.shape[1]} columns",
                    expected=f"column {column} ([recording] {key})",
                )
            return self.matrix[:, column - 1]
        if column not in self.vectors or self.vectors[column].ndim != 1:
            names = [k for k, v in self.vectors.items() if v.ndim == 1]
            raise RefusedError(
                self.source,
                f"no vector {shown(column)} ([recording] {key}){did_you_mean(column, names)}",
                expected="one of " + ", ".join(names) if names else "column numbers",
            )
        return self.vectors[column]


def _vectors(found: Mapping[str, Any], prefix: str = "") -> dict[str, FloatArray]:
    """Numeric arrays; fields of a structure as structure.field."""
    result: dict[str, FloatArray] = {}
    for name, value in found.items():
        if hasattr(value, "_fieldnames"):
            fields = {field: getattr(value, field) for field in value._fieldnames}
            result |= _vectors(fields, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim in (1, 2):
            array = value.astype(np.float64)
            # Samples run down; a matrix with more columns than rows is turned.
            if array.ndim == 2 and array.shape[0] < array.shape[1]:
                array = array.T
            result[prefix + name] = array
    return result
