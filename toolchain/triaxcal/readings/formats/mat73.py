"""MAT-files of MATLAB 7.3, which are HDF5 with the axes of arrays exchanged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.readings.formats.hdf5 import data_sets
from triaxcal.unit.recordingfile import FileLayout


class _Samples:
    """A data set of two dimensions with samples running down, a vector where it is one."""

    def __init__(self, data: Any) -> None:
        self._data, self.dtype = data, data.dtype
        self._turned = data.shape[0] < data.shape[1]
        count, width = sorted(data.shape, reverse=True)
        self.shape = (count, width) if width > 1 else (count,)

    def __getitem__(self, key: Any) -> Any:
        rows, column = key if isinstance(key, tuple) else (key, 0)
        return self._data[column, rows] if self._turned else self._data[rows, column]


def _open(path: Path, layout: FileLayout) -> Source:
    arrays = {
        name.replace("/", "."): _Samples(data)
        for name, data in data_sets(path).items()
        if data.ndim == 2 and data.dtype.kind in "fiu" and "#" not in name
    }
    return ArraySource(str(path), arrays, layout)


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
