"""PX4 ULog by pyulog."""

from __future__ import annotations

import io
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import Format, Source, starts_with
from triaxcal.readings.quiet import quiet
from triaxcal.unit.recordingfile import FileLayout


class _File(io.BufferedReader):
    """A file that knows whether it ended within what was asked for."""

    cut = False

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        # pyulog asks for the three bytes of a header until there are none.
        self.cut = len(data) < (size or 0) and (data != b"" or size != 3)
        return data


def _open(path: Path, layout: FileLayout) -> Source:
    from pyulog import core  # noqa: PLC0415  optional

    with _File(io.FileIO(path)) as file, quiet(core):
        log = core.ULog(file)
    if log.file_corruption:
        raise RefusedError(
            str(path),
            "damaged: the log holds bytes that are no message",
            expected="a whole ULog",
            remedy="download it again",
        )
    topics = {
        d.name + f"[{d.multi_id}]" * (d.multi_id > 0): {
            field: values for field, values in d.data.items() if "_padding" not in field
        }
        for d in log.data_list
    }
    arrays = {f"{t}.{field}": v for t, data in topics.items() for field, v in data.items()}
    source = ArraySource(str(path), arrays, layout)
    source.tables = tuple(topic for topic, data in topics.items() for _ in data)
    source.clocks = {
        topic: (source.names.index(f"{topic}.timestamp"), "us")
        for topic, data in topics.items()
        if "timestamp" in data
    }
    if file.cut:
        source.findings = ("the log ends within a message: it was cut, and is read to there",)
    return source


ENTRY = Format(
    name="ulog",
    label="PX4 ULog",
    doc="A column is topic.field, as sensor_combined.accelerometer_m_s2[0]; of the second instance "
    "of a topic, sensor_accel[1].x. Its clock is timestamp. Loaded whole.",
    open=_open,
    extensions=(".ulg",),
    sniff=starts_with(b"ULog\x01\x12\x35"),
    package="pyulog",
    extra="ulog",
)
