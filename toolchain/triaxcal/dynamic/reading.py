"""Recordings from files: CSV, Parquet and HDF5, read in pieces.

Text is turned into numbers once: a CSV file is copied into a file of doubles in a temporary
folder, which every pass of the filter then reads. The memory does not grow with the length.
"""

from __future__ import annotations

import importlib
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.model.types import FloatArray

PIECE = 1 << 16
FULL_SCALE = 0.999
"""Of the stated range: scale factors have errors too."""
_KINDS = ".csv, .parquet, .h5 or .hdf5"
_SPOOLS: list[tempfile.TemporaryDirectory[str]] = []
"""Kept until the interpreter ends: a recording is read more than once."""


def read_recording(unit: DynamicDescription) -> ImuRecording:
    """Recording of a unit.

    Raises
    ------
    RefusedError
        When the file is absent, of another kind, has not the columns that unit.toml names, or
        holds what is no number; when times do not rise; when a package is missing.
    """
    path = unit.recording
    if not path.is_file():
        raise RefusedError(
            str(path),
            "no such file",
            expected="the recording that unit.toml names",
            remedy=_how_to_get_it(unit.path.parent),
        )
    names = _names(unit)
    tables: Callable[[], Iterator[FloatArray]]
    if path.suffix.lower() == ".csv":
        tables = _csv(path, names)
    elif path.suffix.lower() == ".parquet":
        tables = _parquet(path, names)
    elif path.suffix.lower() in {".h5", ".hdf5"}:
        tables = _hdf5(path, names)
    else:
        raise RefusedError(str(path), f"ends in {path.suffix!r}", expected=_KINDS)
    rate_hz = unit.rate_hz if unit.rate_hz is not None else _rate_hz(unit, tables)
    return ImuRecording(
        name=str(path),
        pieces=lambda: _pieces(unit, names, tables, rate_hz),
        rate_hz=rate_hz,
        latitude_deg=unit.latitude_deg,
        gravity_m_per_s2=unit.gravity_m_per_s2,
        rate_convention=unit.rate_convention,
        force_convention=unit.force_convention,
        table=unit.table,
    )


def _how_to_get_it(folder: Path) -> str:
    if (folder / "imu_truth.toml").is_file():
        return f"make simulate UNIT={folder.name}, or triaxcal simulate {folder}, writes it"
    return "put it there, or correct [dynamic] recording"


def _names(unit: DynamicDescription) -> list[str]:
    """Columns that are needed, each once."""
    c = unit.columns
    wanted = [c.time, *c.rate, *c.force, *(c.force2 or ()), c.temp, c.table_angle]
    return list(dict.fromkeys(name for name in wanted if name is not None))


def _pieces(
    unit: DynamicDescription,
    names: list[str],
    tables: Callable[[], Iterator[FloatArray]],
    rate_hz: float,
) -> Iterator[ImuSamples]:
    """Samples in SI units, checked."""
    c = unit.columns
    count, last_s = 0, -np.inf

    def columns(table: FloatArray, wanted: tuple[str, ...]) -> FloatArray:
        return np.ascontiguousarray(table[:, [names.index(name) for name in wanted]])

    for table in tables():
        _refuse_non_numbers(unit.recording, names, table, count)
        if c.time is None:
            time_s = (count + np.arange(len(table))) / rate_hz
        else:
            time_s = table[:, names.index(c.time)] * c.time_scale
        steps = np.diff(time_s, prepend=last_s)
        if np.any(steps <= 0):
            row = int(np.argmin(steps > 0))
            raise RefusedError(
                f"{unit.recording}, row {count + row + 2}",
                f"time {time_s[row]:g} s does not rise",
                expected="times that rise from row to row",
            )
        _refuse_full_scale(unit, time_s, columns(table, c.rate) * c.rate_scale, 1 / rate_hz)
        yield ImuSamples(
            time_s,
            columns(table, c.rate) * c.rate_scale,
            columns(table, c.force) * c.force_scale,
            None if c.temp is None else columns(table, (c.temp,))[:, 0],
            None if c.force2 is None else columns(table, c.force2) * c.force_scale,
            None if c.table_angle is None else np.radians(columns(table, (c.table_angle,))[:, 0]),
        )
        count, last_s = count + len(table), float(time_s[-1])
    if count == 0:
        raise RefusedError(str(unit.recording), "holds no samples")


def _refuse_full_scale(
    unit: DynamicDescription, time_s: FloatArray, rate: FloatArray, interval_s: float
) -> None:
    """Refuse rates beyond the range that unit.toml states, where it states one."""
    if unit.rate_max is None:
        return
    if unit.rate_convention == INCREMENT:
        rate = rate / np.diff(time_s, prepend=time_s[0] - interval_s)[:, None]
    beyond = np.argwhere(np.abs(rate) >= FULL_SCALE * unit.rate_max)
    if len(beyond):
        row, axis = beyond[0]
        raise RefusedError(
            f"{unit.recording}, {time_s[row]:.2f} s",
            f"gyro {'xyz'[axis]} reads {np.degrees(rate[row, axis]):.4g} deg/s: it is saturated",
            expected=f"rates within its range, {np.degrees(unit.rate_max):.4g} deg/s",
            remedy="turn more slowly, or correct rate_max in [dynamic]",
        )


def _refuse_non_numbers(path: Path, names: list[str], table: FloatArray, before: int) -> None:
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0]
        raise RefusedError(
            f"{path}, row {before + row + 2}, {names[column]}",
            f"found {table[row, column]}",
            expected="a finite number",
        )


def _rate_hz(unit: DynamicDescription, tables: Callable[[], Iterator[FloatArray]]) -> float:
    """Nominal rate: one over the median step of the first piece."""
    first = next(tables(), None)
    names, time = _names(unit), unit.columns.time
    assert time is not None
    if first is None or len(first) < 3:
        raise RefusedError(str(unit.recording), "holds fewer than three samples")
    _refuse_non_numbers(unit.recording, names, first, 0)
    step = float(np.median(np.diff(first[:, names.index(time)]))) * unit.columns.time_scale
    if not step > 0:
        raise RefusedError(
            f"{unit.recording}, {time}", f"a median step of {step:g} s", expected="times that rise"
        )
    return 1 / step


def _missing(path: Path, names: list[str], there: list[str]) -> None:
    for name in names:
        if name not in there:
            raise RefusedError(
                str(path),
                f"no column {name!r}{did_you_mean(name, there)}",
                expected="the columns that unit.toml names",
                remedy="its columns are " + ", ".join(there[:20]),
            )


def _csv(path: Path, names: list[str]) -> Callable[[], Iterator[FloatArray]]:
    try:
        with path.open(encoding="utf-8-sig") as file:
            spool = _spooled(file, path, names)
    except UnicodeDecodeError as error:
        raise RefusedError(str(path), "is not UTF-8 text", expected="a CSV file") from error

    def tables() -> Iterator[FloatArray]:
        with spool.open("rb") as file:
            while len(part := np.fromfile(file, count=PIECE * len(names))):
                yield part.reshape(-1, len(names))

    return tables


def _spooled(file: TextIO, path: Path, names: list[str]) -> Path:
    """File of doubles, row by row, with the wanted columns of a CSV file."""
    line, row = file.readline(), 2
    while line.startswith("#"):
        line, row = file.readline(), row + 1
    header = [cell.strip().strip('"') for cell in line.rstrip("\r\n").split(",")]
    _missing(path, names, header)
    chosen = [header.index(name) for name in names]
    folder = tempfile.TemporaryDirectory(prefix="triaxcal-")
    _SPOOLS.append(folder)
    spool = Path(folder.name) / "recording"
    with spool.open("wb") as out:
        while True:
            try:
                with warnings.catch_warnings():
                    warnings.filterwarnings("ignore", "loadtxt: input contained no data")
                    part = np.loadtxt(file, delimiter=",", usecols=chosen, max_rows=PIECE, ndmin=2)
            except ValueError as error:
                raise RefusedError(
                    f"{path}, rows {row} to {row + PIECE - 1}",
                    str(error).split(";")[0],
                    expected=f"numbers in {len(header)} columns",
                ) from error
            if len(part) == 0:
                return spool
            part.tofile(out)
            row += len(part)


def _package(name: str, path: Path) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise RefusedError(
            str(path),
            f"the package {name.split('.', maxsplit=1)[0]} is missing",
            remedy="install it: pip install 'triaxcal[recordings]'",
        ) from error


def _parquet(path: Path, names: list[str]) -> Callable[[], Iterator[FloatArray]]:
    parquet = _package("pyarrow.parquet", path)
    try:
        _missing(path, names, list(parquet.read_schema(path).names))
    except (ValueError, OSError) as error:
        raise RefusedError(str(path), "is not a Parquet file") from error

    def tables() -> Iterator[FloatArray]:
        with parquet.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=PIECE, columns=names):
                columns = [
                    _doubles(path, name, batch.column(name).to_numpy(zero_copy_only=False))
                    for name in names
                ]
                yield np.column_stack(columns)

    return tables


def _doubles(path: Path, name: str, values: Any) -> FloatArray:
    """Numbers of a column; text and dates are refused."""
    try:
        if values.dtype.kind not in "biufO":
            raise ValueError
        found: FloatArray = values.astype(np.float64)
    except (ValueError, TypeError) as error:
        first = values[0] if len(values) else ""
        raise RefusedError(
            f"{path}, column {name}",
            f"holds {values.dtype}, the first is {str(first)[:40]!r}",
            expected="numbers",
            remedy="write the column as numbers, or name another",
        ) from error
    return found


def _hdf5(path: Path, names: list[str]) -> Callable[[], Iterator[FloatArray]]:
    h5py = _package("h5py", path)

    def opened() -> Any:
        try:
            return h5py.File(path, "r")
        except OSError as error:
            raise RefusedError(str(path), "is not an HDF5 file") from error

    with opened() as file:
        there: list[str] = []
        file.visititems(
            lambda name, item: there.append(name) if isinstance(item, h5py.Dataset) else None
        )
        _missing(path, names, there)
        lengths = {name: file[name].shape for name in names}
    if len(set(lengths.values())) != 1 or len(next(iter(lengths.values()))) != 1:
        raise RefusedError(
            str(path),
            "data sets of shapes " + ", ".join(f"{n} {s}" for n, s in lengths.items()),
            expected="one value a sample in each",
        )
    count = next(iter(lengths.values()))[0]

    def tables() -> Iterator[FloatArray]:
        with opened() as file:
            for start in range(0, count, PIECE):
                parts = [_doubles(path, name, file[name][start : start + PIECE]) for name in names]
                yield np.column_stack(parts)

    return tables
