"""Bags of ROS 1 and 2, and MCAP, by rosbags; read message after message."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

from triaxcal.readings.arrays import Pieces, column_of
from triaxcal.readings.format import PIECE, Block, Format, Source, starts_with
from triaxcal.unit.recordingfile import FileLayout

_BASE, _NAME, _ARRAY = 1, 2, 3
"""Kinds of a field: `rosbags.interfaces.Nodetype`."""
_TIME = "builtin_interfaces/msg/Time"


class _Bag(Source):
    def __init__(self, path: Path, layout: FileLayout) -> None:  # noqa: ARG002
        self._path = path
        with self._opened() as bag:
            types = {c.topic: c.msgtype for c in bag.connections}
            fields = {topic: ["time", *_fields(bag.typestore.fielddefs, kind)]
                      for topic, kind in types.items()}  # fmt: skip
        pairs = [(topic, field) for topic, found in fields.items() for field in found]
        self.tables = tuple(topic for topic, _ in pairs)
        self._fields = [field for _, field in pairs]
        self.names = tuple(f"{topic}.{field}" for topic, field in pairs)
        self.clocks = {topic: (self.names.index(f"{topic}.time"), "ns") for topic in fields}

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        pieces = Pieces(str(self._path), self.names, numbers, texts)
        getters = [_getter(self._fields[k]) for k in pieces.wanted]
        with self._opened() as bag:
            chosen = [c for c in bag.connections if c.topic == self.tables[pieces.wanted[0]]]
            rows = (
                [get(stamp, message) for get in getters]
                for connection, stamp, raw in bag.messages(chosen)
                for message in (bag.deserialize(raw, connection.msgtype),)
            )
            while part := list(islice(rows, PIECE)):
                columns = map(column_of, zip(*part, strict=True))
                yield pieces.block(dict(zip(pieces.wanted, columns, strict=True)))

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415  optional
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

        # Older bags of ROS 2 do not hold the definitions of their messages.
        with AnyReader([self._path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            yield bag


def _fields(definitions: Any, kind: str, prefix: str = "") -> Iterator[str]:
    """Fields of a message that hold one value each; arrays of fixed length by their elements."""
    for name, (node, detail) in definitions[kind][1]:
        full = prefix + name
        if node == _BASE:
            yield full
        elif node == _ARRAY:
            yield from (f"{full}[{k}]" for k in range(detail[1]))
        elif node == _NAME and detail == _TIME:
            yield full
        elif node == _NAME:
            yield from _fields(definitions, detail, full + ".")


def _getter(field: str) -> Callable[[int, Any], Any]:
    """What takes a field from a message and its time in the bag, ns; a time as whole ns."""
    element = re.fullmatch(r"(.*)\[(\d+)\]", field)
    take = attrgetter(element[1] if element else field)
    index = int(element[2]) if element else 0

    def value(stamp: int, message: Any) -> Any:
        if field == "time":
            return stamp
        found = take(message)
        if element:
            return found[index]
        return found.sec * 10**9 + found.nanosec if hasattr(found, "nanosec") else found

    return value


ENTRY = Format(
    name="ros",
    label="a ROS bag or MCAP",
    doc="A column is topic.field, as /imu/data.linear_acceleration.x. Its clock is the time at "
    'which the message was recorded; that of the sensor is time = "header.stamp" with time_unit '
    '= "ns". A bag of ROS 2 is the folder with metadata.yaml, or its .mcap or .db3 file. Read '
    "message after message.",
    open=_Bag,
    extensions=(".bag", ".mcap", ".db3"),
    sniff=starts_with(b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"rosbag2_bagfile_information"),
    package="rosbags",
    extra="ros",
)
