"""HDF5 by h5py: data sets by their paths, read in pieces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout


def _open(path: Path, layout: FileLayout) -> Source:
    return ArraySource(str(path), data_sets(path), layout)


def data_sets(path: Path) -> dict[str, Any]:
    """Data sets of an HDF5 file of at least one dimension by their paths."""
    import h5py  # noqa: PLC0415  optional

    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.shape:
            found[name] = item

    h5py.File(path, "r").visititems(visit)
    return found  # the last of them closes the file


ENTRY = Format(
    name="hdf5",
    label="HDF5",
    doc="A column is a data set by its path, as imu/ax; of one with two dimensions, imu/acc[0]; of "
    "one of records, imu/table.ax. Read in pieces.",
    open=_open,
    extensions=(".h5", ".hdf5", ".he5"),
    sniff=starts_with(b"\x89HDF\r\n\x1a\n"),
    package="h5py",
    extra="hdf5",
)
