"""MAT-files of MATLAB 7.3, which are HDF5 with the axes of arrays exchanged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.readings.formats.hdf5 import data_sets
from triaxcal.readings.formats.mat import is_turned, told
from triaxcal.unit.recordingfile import FileLayout


class _Samples:
    """A data set of two dimensions with samples running down, a vector where it is one."""

    def __init__(self, data: Any, layout: FileLayout) -> None:
        self._data, self.dtype = data, data.dtype
        width, count = data.shape
        vector = 1 in data.shape
        self.turned = not vector and is_turned((count, width), layout)
        self._rows_first = self.turned or count == 1
        if self._rows_first:
            count, width = width, count
        self.shape = (count,) if vector else (count, width)

    def __getitem__(self, key: Any) -> Any:
        rows, column = key if isinstance(key, tuple) else (key, 0)
        return self._data[rows, column] if self._rows_first else self._data[column, rows]


def _open(path: Path, layout: FileLayout) -> Source:
    arrays = {
        name.replace("/", "."): _Samples(data, layout)
        for name, data in data_sets(path).items()
        if data.ndim == 2 and data.dtype.kind in "fiu" and "#" not in name
    }
    source = ArraySource(str(path), arrays, layout)
    source.findings = told([name for name, data in arrays.items() if data.turned])
    return source


ENTRY = Format(
    name="mat73",
    label="a MAT-file of version 7.3",
    doc="As the older MAT-files; read in pieces.",
    open=_open,
    sniff=starts_with(b"MATLAB 7.3"),
    package="h5py",
    extra="hdf5",
    rank=50,
)
