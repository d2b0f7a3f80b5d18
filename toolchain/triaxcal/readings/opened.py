"""A recording opened: its format found, its columns by name or number, its damage in one line."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.extras import install_command
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import FORMATS, Block, Format, Source
from triaxcal.readings.names import meant
from triaxcal.unit.recordingfile import Column, FileLayout

_HEAD = 4096
"""Bytes at the start of a file by which its format is found."""
_FOLDERS_FILE = "metadata.yaml"
_NAMES_SHOWN = 20
_BINARY = (
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"\x1f\x8b", "packed by gzip"),
    (b"SQLite format 3", "an SQLite database"),
)


class RecordingFile:
    """A recording opened by the format that it has; found by its content, then by its name.

    Attributes
    ----------
    path : Path
    layout : FileLayout
    source : Source
    """

    def __init__(
        self, path: Path, layout: FileLayout, columns: Mapping[str, Any] | None = None
    ) -> None:
        """Open `path`, or take the `columns` of a program; `path` is then only for messages.

        Raises
        ------
        RefusedError
            When the file cannot be read, is of no known format or damaged, or needs a package that
            is missing.
        """
        self.path, self.layout = path, layout
        self._given = columns is not None
        if columns is not None:
            arrays = {str(name): np.asarray(values) for name, values in columns.items()}
            self._format = FORMATS["text"]  # what is raised over arrays is a fault of our own
            self.source: Source = ArraySource(str(path), arrays, layout)
            return
        self._stamp = _stamp(path, layout)
        self._format = _format_of(path, layout)
        if self._format.package and importlib.util.find_spec(self._format.package) is None:
            raise self._missing(self._format.package)
        with self._one_line():
            self.source = self._format.open(path, layout)

    def index(self, column: Column, key: str) -> int:
        """Index of a column by its name or number; `key` is the key that names it.

        Raises
        ------
        RefusedError
            When there is none of that name or number, or more than one.
        """
        key = f"[{self.layout.table}] {key}"
        names = self.source.names
        if isinstance(column, int):
            count = len(self.source.numbered)
            if column <= count:
                return self.source.numbered[column - 1]
            if not count:
                raise self._refused(
                    f"holds {_some(names) or 'no numbers'}",
                    f"one matrix for column {column} ({key})",
                    'name it: variable = "..."',
                )
            check = "; check the delimiter" if self.source.row_word == "line" else ""
            raise self._refused(
                f"{count} columns", f"column {column} ({key})", "columns are counted from 1" + check
            )
        found = meant(column, names, self.layout.variable)
        if len(found) == 1:
            return found[0]
        raise self._no_column(column, key, found)

    def _no_column(self, column: str, key: str, found: Sequence[int]) -> RefusedError:
        names, wanted = self.source.names, f"{shown(column)} ({key})"
        if found:
            full = sorted({names[k] for k in found})
            several = f"{len(found)} columns {wanted}"
            if len(full) == 1:
                return self._refused(several, "one of that name", "give its number from 1")
            return self._refused(several, "one of " + _some(full))
        if not any(names) and self.source.row_word != "line":
            return self._refused("holds no columns", f"column {wanted}")
        if not any(names):
            return self._refused(
                f"no header, so no column {wanted}",
                "column numbers from 1",
                "give numbers, or header = true if the first line is one",
            )
        hint = did_you_mean(column, names)
        remedy = ""
        if len(names) == 1 and self.source.separated:
            remedy = (
                f"a line is one cell when {self.source.separated} separates the cells; if another "
                f"sign does, name it: delimiter in [{self.layout.table}]"
            )
        return self._refused(f"no column {wanted}{hint}", "one of " + _some(names), remedy)

    def _refused(self, found: str, expected: str, remedy: str = "") -> RefusedError:
        return RefusedError(str(self.path), found, expected=expected, remedy=remedy)

    def blocks(self, numbers: Sequence[int], texts: Sequence[int] = ()) -> Iterator[Block]:
        """Blocks of the wanted columns, as `Source.blocks`.

        Raises
        ------
        RefusedError
            When the file holds what is no number there, is damaged, or changes while it is read.
        """
        tables = {self.source.tables[k]: self.source.names[k] for k in (*numbers, *texts)
                  if self.source.tables}  # fmt: skip
        if len(tables) > 1:
            raise self._refused(
                "columns of several tables: " + ", ".join(tables.values()),
                "columns of one table, which has one clock",
                "name columns of one, or export them at common times",
            )
        with self._one_line():
            yield from self.source.blocks(numbers, texts)
        if not self._given and _stamp(self.path, self.layout) != self._stamp:
            raise self._refused(
                "changed while it was read",
                "a recording that is complete",
                "wait until the logger has closed it, or copy it first",
            )

    @contextmanager
    def _one_line(self) -> Iterator[None]:
        """What a package raises over a file, as an error of one line."""
        try:
            yield
        except RefusedError:
            raise
        except ImportError as error:
            raise self._missing((error.name or str(error)).split(".")[0]) from error
        except Exception as error:
            if self._format.ours:
                raise
            text = str(error).strip().split("\n")[0] or type(error).__name__
            raise RefusedError(
                str(self.path), f"damaged, or not {self._format.label}: {text[:200]}"
            ) from error

    def _missing(self, package: str) -> RefusedError:
        return self._refused(
            f"the package {package} is missing",
            f"it, to read {self._format.label}",
            "install it: " + install_command(self._format.extra),
        )


def _some(names: Sequence[str]) -> str:
    more = ", ..." if len(names) > _NAMES_SHOWN else ""
    return ", ".join(name for name in names[:_NAMES_SHOWN] if name) + more


def _stamp(path: Path, layout: FileLayout) -> list[tuple[int, int, int]]:
    """What changes with the content of a file, or of the files of a folder."""
    try:
        stats = [file.stat() for file in (path, *(path.iterdir() if path.is_dir() else ()))]
    except OSError as error:
        raise _unreadable(path, layout, error) from error
    return [(found.st_size, found.st_mtime_ns, found.st_ino) for found in stats]


def _unreadable(path: Path, layout: FileLayout, error: OSError) -> RefusedError:
    key = "recording" if layout.table == "dynamic" else "file"
    remedy = f"put the recording there, or correct [{layout.table}] {key}"
    return refused_by_system(path, "read", error, remedy=remedy)


def _format_of(path: Path, layout: FileLayout) -> Format:
    if layout.format is not None:
        try:
            return FORMATS[layout.format]
        except RefusedError as unknown:
            where = f"{path}, [{layout.table}] format"
            raise RefusedError(where, unknown.found, expected=unknown.expected) from None
    if path.is_dir() and not (path / _FOLDERS_FILE).is_file():
        raise RefusedError(
            str(path),
            f"a folder without {_FOLDERS_FILE}",
            expected="a recording: a file, or the folder of a ROS 2 bag",
            remedy="name the file in it",
        )
    try:
        # Of a folder, as ROS 2 writes bags, the file that describes it is asked.
        with (path / _FOLDERS_FILE if path.is_dir() else path).open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise _unreadable(path, layout, error) from error
    suffix = path.suffix.lower()
    entries = [e for e in FORMATS if e.sniff(head)]
    entries += [e for e in FORMATS if suffix in e.extensions]
    if entries:
        return entries[0]
    raise RefusedError(
        str(path),
        f"a binary file{_what_binary(head)}",
        expected=", ".join(entry.label for entry in FORMATS),
        remedy="export it as CSV",
    )


def _what_binary(head: bytes) -> str:
    """What a well-known binary file is."""
    return next((f", {name}" for start, name in _BINARY if head.startswith(start)), "")
