"""ArduPilot's DataFlash logs (.BIN): their index by pymavlink, their messages in pieces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import IntArray
from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import PIECE, Format, Source, starts_with
from triaxcal.readings.quiet import quiet
from triaxcal.unit.recordingfile import FileLayout

_HEAD = 3
"""Bytes of a message before its fields: two of synchronisation, and its type."""
_PAGE = 528
"""Bytes at most that the last page of a flash chip leaves behind the last message."""


class _Messages:
    """Messages of one kind as records, taken from the file where they are asked for.

    Parameters
    ----------
    data : array of bytes
        The file.
    offsets : array, shape (n,)
        Where the fields of each message start.
    fields : sequence of (name, type for numpy, divisor)
    """

    def __init__(
        self, data: Any, offsets: IntArray, fields: Sequence[tuple[str, str, int]]
    ) -> None:
        self._data, self._offsets = data, offsets
        self._stored = np.dtype([(name, kind) for name, kind, _ in fields])
        self._divisors = {name: divisor for name, _, divisor in fields}
        self.dtype = np.dtype([(n, "<f8" if d > 1 else kind) for n, kind, d in fields])
        self.shape = offsets.shape

    def __getitem__(self, part: Any) -> Any:
        places = self._offsets[part][:, None] + np.arange(self._stored.itemsize)
        raw = np.ascontiguousarray(self._data[places]).view(self._stored)[:, 0]
        found = np.empty(len(raw), self.dtype)
        for name, divisor in self._divisors.items():
            found[name] = raw[name] / divisor if divisor > 1 else raw[name]
        return found


def _open(path: Path, layout: FileLayout) -> Source:
    from pymavlink import DFReader  # noqa: PLC0415  optional

    class Log(DFReader.DFReader_binary):  # type: ignore[misc]
        def init_arrays_fast(self, progress_callback: Any = None) -> None:
            """The indexer in C prints what it finds wrong, and nothing can stop it."""
            self.init_arrays(progress_callback)

        def init_clock(self) -> None:
            """Time of day is not needed; without GPS it costs a pass through the log."""

    with quiet(DFReader), Log(str(path)) as log:
        kinds = [(kind, log.formats[kind]) for kind in range(256) if log.counts[kind] > 0]
    data = np.memmap(path, np.uint8, "r")
    starts = {kind: np.array(log.offsets[kind], np.int64) for kind, _ in kinds}
    findings = _whole(path, starts, {kind: layout.len for kind, layout in kinds}, len(data))
    arrays: dict[str, _Messages] = {}
    for kind, form in kinds:
        fields = [_field(name, DFReader.FORMAT_TO_STRUCT[code])
                  for name, code in zip(form.columns, form.msg_fmts, strict=False)]  # fmt: skip
        offsets = starts[kind][starts[kind] + form.len <= len(data)] + _HEAD
        messages = _Messages(data, offsets, fields)
        if form.instance_field is None or not len(offsets):
            arrays[form.name] = messages
            continue
        parts = range(0, len(offsets), PIECE)
        instance = np.concatenate([messages[k : k + PIECE][form.instance_field] for k in parts])
        for number in np.unique(instance).tolist():
            table = form.name + f"[{number}]" * (number != 0)
            arrays[table] = _Messages(data, offsets[instance == number], fields)
    source = ArraySource(str(path), arrays, layout)
    source.tables = tuple(t for t, a in arrays.items() for _ in a.dtype.names or ())
    source.clocks = {
        t: (source.names.index(f"{t}.TimeUS"), "us")
        for t, a in arrays.items()
        if "TimeUS" in (a.dtype.names or ())
    }
    source.findings = findings
    return source


def _field(name: str, form: tuple[str, float | None, Any]) -> tuple[str, str, int]:
    """Name, type and divisor of a field: a hundredth is not a double, a hundred is."""
    code, scale, _ = form
    kind = f"S{code[:-1]}" if code.endswith("s") else "<" + {"e": "f2"}.get(code, code)
    return name, kind, round(1 / scale) if scale else 1


def _whole(
    path: Path, starts: Mapping[int, IntArray], lengths: Mapping[int, int], size: int
) -> tuple[str, ...]:
    """Refuse a log with other bytes between its messages; report one that was cut."""
    last = max(int(found[-1]) + lengths[kind] for kind, found in starts.items())
    rest = size - last if size > last + _PAGE else 0
    if rest or sum(len(found) * lengths[kind] for kind, found in starts.items()) != last:
        begin = np.sort(np.concatenate([*starts.values(), [last + rest]]))
        end = np.sort(np.concatenate([found + lengths[kind] for kind, found in starts.items()]))
        lost = int(np.argmax(begin[1:] != end))
        raise RefusedError(
            str(path),
            f"damaged: {begin[lost + 1] - end[lost]} bytes from byte {end[lost]} on are no message",
            expected="a whole DataFlash log",
            remedy="download it again",
        )
    if last > size:
        return ("the log ends within a message: it was cut, and is read to there",)
    return ()


ENTRY = Format(
    name="dataflash",
    label="an ArduPilot DataFlash log",
    doc="A column is message.field, as IMU.AccX; of the second instance, IMU[1].AccX. Its clock is "
    "TimeUS. Read in pieces. A log as text (.log) has to be exported as .bin.",
    open=_open,
    extensions=(".bin",),
    sniff=starts_with(b"\xa3\x95\x80\x80"),
    package="pymavlink",
    extra="ardupilot",
)
