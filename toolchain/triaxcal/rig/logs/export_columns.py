"""MF4 and Parquet, written by whole columns: the packages are optional and imported here alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.model.types import FloatArray
from triaxcal.rig.bus.frames import (
    BRS,
    DLC_SHIFT,
    ESI,
    FD_LENGTHS,
    ID_MASK,
    SENT,
    BoolArray,
    ByteArray,
    Frames,
    widened,
)


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
        "BusChannel": _channel_numbers(frames),
        "ID": frames.can_id & np.uint32(ID_MASK),
        "IDE": frames.flags[0],
        "DLC": np.where(
            frames.marks >> DLC_SHIFT,
            frames.marks >> DLC_SHIFT,
            np.searchsorted(FD_LENGTHS, frames.length),
        ),
        "DataLength": frames.length,
        "DataBytes": widened(frames.data, 64),
        "Dir": (frames.marks & SENT) != 0,
        "EDL": frames.fd,
        "BRS": (frames.marks & BRS) != 0,
        "ESI": (frames.marks & ESI) != 0,
    }
    for name, values in columns.items():
        if f"{group}.{name}" in (records.dtype.names or ()):
            records[f"{group}.{name}"] = values
    return records


def _channel_numbers(frames: Frames) -> ByteArray:
    """Number in the name of each frame's channel, 1 where there is none."""
    names, place = np.unique(frames.channel, return_inverse=True)
    found = [re.search(rb"\d{1,2}$", name) for name in names.tolist()]
    return np.array([int(m[0]) if m else 1 for m in found], np.uint8)[place]


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
            ("length", arrow.uint8()),
            *((flag, arrow.bool_()) for flag in ("brs", "esi", "sent")),
            ("dlc", arrow.uint8()),
            ("channel", arrow.string()),
        ]
    )
    with parquet.ParquetWriter(target, schema) as file:

        def put(frames: Frames) -> None:
            if not len(frames):
                return
            size = np.where(frames.flags[1], 0, frames.length)  # a remote request has no payload
            inside = np.arange(frames.data.shape[1]) < size[:, None]
            ends = np.concatenate([[0], np.cumsum(size, dtype=np.int32)]).astype(np.int32)
            payload = arrow.Array.from_buffers(
                arrow.binary(),
                len(frames),
                [None, arrow.py_buffer(ends), arrow.py_buffer(frames.data[inside].tobytes())],
            )
            columns = [
                *(frames.t_ns, frames.can_id & np.uint32(ID_MASK), *frames.flags, frames.fd),
                *(payload, frames.length),
                *((frames.marks & bit) != 0 for bit in (BRS, ESI, SENT)),
                frames.marks >> DLC_SHIFT,
                [name.decode("utf-8", "replace") for name in frames.channel.tolist()],
            ]
            arrays = [
                c if c is payload else arrow.array(c, type=t.type)
                for c, t in zip(columns, schema, strict=True)
            ]
            file.write_table(arrow.Table.from_arrays(arrays, schema=schema))

        yield put
