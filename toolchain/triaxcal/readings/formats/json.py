"""JSON: an object of arrays, an array of records, or a record a line."""

from __future__ import annotations

import json
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.readings.arrays import ArraySource, Pieces, column_of
from triaxcal.readings.format import PIECE, Block, Format, Source
from triaxcal.unit.recordingfile import FileLayout

_Path = tuple[str | int, ...]
_NAMES_WITHIN = 1000
"""Lines in which all names are looked for."""


def _open(path: Path, layout: FileLayout) -> Source:
    with path.open(encoding="utf-8-sig") as file:
        first, second = file.readline().strip(), file.readline().strip()
    if first.startswith("{") and first.endswith("}") and second.startswith("{"):
        return _Lines(path)
    with path.open(encoding="utf-8-sig") as file:
        found = json.load(file, object_pairs_hook=_object)
    return ArraySource(str(path), _columns(found), layout)


def _once(parts: Iterator[dict[str, Any]]) -> dict[str, Any]:
    """All columns; two of one full name, as of "imu.ax" and of "ax" in "imu", are refused."""
    found: dict[str, Any] = {}
    for part in parts:
        twice = found.keys() & part.keys()
        if twice:
            raise ValueError(f"two columns of one name, {min(twice)!r}")
        found |= part
    return found


class _Lines(Source):
    """A record a line."""

    row_word = "line"

    def __init__(self, path: Path) -> None:
        self._path = path
        with closing(self._records(object_pairs_hook=_object)) as records:
            first = (record for _, record in islice(records, _NAMES_WITHIN))
            self._paths = {name: way for record in first for name, way in _paths(record).items()}
        self.names = tuple(self._paths)

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`."""
        pieces = Pieces(str(self._path), self.names, numbers, texts)
        ways = {k: self._paths[self.names[k]] for k in pieces.wanted}
        with closing(self._records()) as records:
            while part := list(islice(records, PIECE)):
                yield pieces.block(
                    {k: column_of([_at(r, way) for _, r in part]) for k, way in ways.items()},
                    np.array([line for line, _ in part]),
                )

    def _records(self, **options: Any) -> Generator[tuple[int, Any], None, None]:
        with self._path.open(encoding="utf-8-sig") as file:
            for line, text in enumerate(file, 1):
                if text.strip():
                    try:
                        yield line, json.loads(text, **options)
                    except ValueError as error:
                        raise RefusedError(
                            f"{self._path}, line {line}",
                            f"damaged JSON: {error}",
                            expected="one record a line",
                            remedy="remove the line if the file was cut there",
                        ) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Object of JSON without names that come twice: Python would keep the last."""
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two values of one name, {twice!r}")
    return found


def _columns(value: Any, prefix: str = "") -> dict[str, Any]:
    """Arrays by name; those of an object or of records as prefix.name."""
    if isinstance(value, Mapping):
        parts = (_columns(v, f"{prefix}.{k}" if prefix else k) for k, v in value.items())
        return _once(parts)
    if not isinstance(value, list) or not value:
        return {}
    if all(isinstance(item, Mapping) for item in value):
        ways = {n: way for item in value for n, way in _paths(item, prefix).items()}
        return {name: column_of([_at(item, way) for item in value]) for name, way in ways.items()}
    if all(isinstance(item, list) and len(item) == len(value[0]) for item in value):
        # Beside numbers numpy takes true and false for 1 and 0.
        bools = any(isinstance(cell, bool) for row in value for cell in row)
        return {prefix: np.array(value, dtype=object if bools else None)}
    return {prefix: column_of(value)}


def _paths(value: Any, name: str = "", way: _Path = ()) -> dict[str, _Path]:
    """Ways to the values of one record by their names: name.field, name[0]."""
    if isinstance(value, Mapping):
        parts = (_paths(v, f"{name}.{k}" if name else k, (*way, k)) for k, v in value.items())
    elif isinstance(value, list):
        parts = (_paths(v, f"{name}[{k}]", (*way, k)) for k, v in enumerate(value))
    else:
        return {name: way}
    return _once(parts)


def _at(record: Any, way: _Path) -> Any:
    """Value of a record; None where it has none there."""
    try:
        for step in way:
            record = record[step]
    except (KeyError, IndexError, TypeError):
        return None
    return record


ENTRY = Format(
    name="json",
    label="JSON",
    doc="An object of arrays, an array of records, or a record a line. A column is the path to its "
    "values, as imu.ax or acc[0]. Loaded whole, but for a record a line.",
    open=_open,
    extensions=(".json", ".jsonl", ".ndjson"),
    sniff=lambda head: re.match(rb'(\xef\xbb\xbf)?\s*(\{\s*"|\[\s*[\[{])', head) is not None,
    package="json",
)
