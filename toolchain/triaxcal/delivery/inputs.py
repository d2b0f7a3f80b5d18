"""Hashes of the files that a calibration is made of."""

from __future__ import annotations

import hashlib
import os
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path

from triaxcal.base.errors import refused_by_system
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.folder import UNIT_FILE
from triaxcal.unit.recordingfile import files_in

PAPERS = ("certificate", "equipment", "passport")
"""Tables of unit.toml that say nothing of the constants: they may be filled in after the flashing.

What the device was flashed with keeps its hash, and so does the record of its verification.
"""
_HEADER = re.compile(r"\s*\[{1,2}\s*([\w-]+)\s*[].]")


def inputs_sha256(folder: Path, unit: UnitDescription | None = None) -> str:
    """Hash of the unit's two files, less `PAPERS`; the same wherever the folder lies."""
    recorded: tuple[Path, ...] = (folder / MEASUREMENTS_FILE,)
    if unit is not None and unit.recording is not None:
        recorded = files_in(folder, unit.recording.file)
    pair = () if unit is None or unit.pair is None else (folder / unit.pair.cross_coupling,)
    remedy = "put it there, or correct its name in unit.toml"
    digest = hashlib.sha256()
    try:
        content = (folder / UNIT_FILE).read_bytes()
    except OSError as error:
        raise refused_by_system(error.filename or folder, "read", error, remedy=remedy) from error
    digest.update(hashlib.sha256(without_papers(content)).digest())
    _add_files(digest, (*recorded, *pair), remedy)
    return digest.hexdigest()


def without_papers(content: bytes) -> bytes:
    """unit.toml without `PAPERS`; as it is where it has none, or has them in another form."""
    try:
        text = content.decode()
        document = tomllib.loads(text)
    except ValueError:  # it is refused elsewhere, with its place
        return content
    kept, paper = [], False
    for line in text.splitlines(keepends=True):
        if header := _HEADER.match(line):
            paper = header[1] in PAPERS
        if not paper:
            kept.append(line)
    cut = "".join(kept).rstrip("\r\n") + ("\r\n" if "\r\n" in text else "\n")
    rest = {name: value for name, value in document.items() if name not in PAPERS}
    return cut.encode() if rest != document and _same(cut, rest) else content


def _same(text: str, document: object) -> bool:
    """Whether a text is this document: a header within a text of several lines may have cut it."""
    try:
        return tomllib.loads(text) == document
    except ValueError:
        return False


def files_sha256(paths: Iterable[Path], remedy: str) -> str:
    """Hash of the hashes of files; `remedy` is what to do where one cannot be read.

    Of a folder, as a bag of ROS 2 is one, the names and contents of all its files count.
    """
    digest = hashlib.sha256()
    _add_files(digest, paths, remedy)
    return digest.hexdigest()


def _add_files(digest: hashlib._Hash, paths: Iterable[Path], remedy: str) -> None:
    for path in paths:
        try:
            for file in files_of(path):
                if file != path:
                    digest.update(file.relative_to(path).as_posix().encode() + b"\0")
                with file.open("rb") as content:
                    digest.update(hashlib.file_digest(content, "sha256").digest())
        except OSError as error:
            raise refused_by_system(error.filename or path, "read", error, remedy=remedy) from error


def files_of(path: Path) -> list[Path]:
    """The file itself, or all files in a folder and its subfolders, sorted.

    Raises
    ------
    OSError
        When a folder cannot be read.
    """
    if not path.is_dir():
        return [path]
    return sorted(
        Path(folder, name) for folder, _, names in os.walk(path, onerror=_raise) for name in names
    )


def _raise(error: OSError) -> None:
    raise error
