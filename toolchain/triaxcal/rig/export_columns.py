"""MF4 and Parquet, written by whole columns: the packages are optional and imported here alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.model.types import FloatArray
from triaxcal.rig.frames import ID_MASK, BoolArray, Frames, widened

_FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def missing(package: str, suffix: str) -> RefusedError:
    """Error of an optional package that is not installed."""
    return RefusedError(
        f"triaxcal rig export, {suffix}",
        f"missing package: {package}",
        remedy="install it: " + install_command("export"),
    )


# ---- MF4 ----

_GROUPS = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")
"""Groups of ASAM's bus logging in MDF 4; asammdf and CANape know the frames by these names."""


def _record(group: str) -> np.dtype[Any]:
    fields: list[Any] = [
        ("BusChannel", "<u1"),
        ("ID", "<u4"),
        ("IDE", "<u1"),
        ("DLC", "<u1"),
        ("DataLength", "<u1"),
        ("DataBytes", "(64,)u1"),
        ("Dir", "<u1"),
        ("EDL", "<u1"),
        ("BRS", "<u1"),
        ("ESI", "<u1"),
    ]
    if group == "CAN_RemoteFrame":
        fields = [field for field in fields if field[0] not in {"DataBytes", "EDL", "BRS", "ESI"}]
    return np.dtype([(f"{group}.{field[0]}", *field[1:]) for field in fields])


@contextmanager
def mf4_writer(target: Path) -> Iterator[Callable[[Frames], None]]:
    """Open an MDF 4 file of bus events; times are seconds since the first frame.

    python-can's own writer is not used: it takes the time of the export for the start and
    calls the library once a frame.
    """
    try:
        import asammdf  # noqa: PLC0415
    except ImportError as error:
        raise missing("asammdf", ".mf4") from error
    bus, can = asammdf.Source.SOURCE_BUS, asammdf.Source.BUS_TYPE_CAN
    source = asammdf.Source("CAN", "", "", source_type=bus, bus_type=can)
    with asammdf.MDF(version="4.10") as file:
        start_ns: list[int] = []

        def put(frames: Frames) -> None:
            if not len(frames):
                return
            if not start_ns:
                # The header keeps whole microseconds, and so does the log.
                start_ns.append(int(frames.t_ns[0]))
                file.header.start_time = _moment(start_ns[0])
                for group in _GROUPS:
                    file.append(asammdf.Signal(
                        name=group, samples=np.array([], _record(group)),
                        timestamps=np.array([], np.float64), source=source,
                    ))  # fmt: skip
            for place, group in enumerate(_GROUPS):
                chosen = frames.take(_of_group(frames, group))
                if len(chosen):
                    t_s: FloatArray = (chosen.t_ns - start_ns[0]) / 1e9
                    file.extend(place, [(t_s, None), (_records(chosen, group), None)])

        yield put
        if start_ns:
            file.save(target, overwrite=True, compression=2)


def _moment(t_ns: int) -> datetime:
    seconds, rest_ns = divmod(t_ns, 10**9)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest_ns // 1000)


def _of_group(frames: Frames, group: str) -> BoolArray:
    _, remote, error = frames.flags
    if group == "CAN_ErrorFrame":
        return error
    return np.asarray(~error & (remote == (group == "CAN_RemoteFrame")), np.bool_)


def _records(frames: Frames, group: str) -> Any:
    records = np.zeros(len(frames), _record(group))
    columns = {
        "BusChannel": 1,
        "ID": frames.can_id & np.uint32(ID_MASK),
        "IDE": frames.flags[0],
        "DLC": np.searchsorted(_FD_LENGTHS, frames.length),
        "DataLength": frames.length,
        "DataBytes": widened(frames.data, 64),
        "EDL": frames.fd,
    }
    for name, values in columns.items():
        if f"{group}.{name}" in (records.dtype.names or ()):
            records[f"{group}.{name}"] = values
    return records


# ---- Parquet ----


@contextmanager
def parquet_writer(target: Path) -> Iterator[Callable[[Frames], None]]:
    """Open a Parquet table, one row a frame; its columns are in docs/reference/can.md."""
    try:
        import pyarrow as arrow  # noqa: PLC0415
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        raise missing("pyarrow", ".parquet") from error
    schema = arrow.schema(
        [
            ("time", arrow.timestamp("ns", tz="UTC")),
            ("id", arrow.uint32()),
            *((flag, arrow.bool_()) for flag in ("extended", "remote", "error", "fd")),
            ("payload", arrow.binary()),
        ]
    )
    with parquet.ParquetWriter(target, schema) as file:

        def put(frames: Frames) -> None:
            if not len(frames):
                return
            inside = np.arange(frames.data.shape[1]) < frames.length[:, None]
            ends = np.concatenate([[0], np.cumsum(frames.length, dtype=np.int32)]).astype(np.int32)
            payload = arrow.Array.from_buffers(
                arrow.binary(),
                len(frames),
                [None, arrow.py_buffer(ends), arrow.py_buffer(frames.data[inside].tobytes())],
            )
            columns = [frames.t_ns, frames.can_id & np.uint32(ID_MASK), *frames.flags]
            columns += [frames.fd, payload]
            file.write_table(arrow.Table.from_arrays(
                [arrow.array(c, type=t.type) for c, t in zip(columns[:-1], schema, strict=False)]
                + columns[-1:],
                schema=schema,
            ))  # fmt: skip

        yield put
