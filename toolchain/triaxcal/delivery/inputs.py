"""Hashes of the files that a calibration is made of."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from triaxcal.base.errors import refused_by_system
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.folder import UNIT_FILE
from triaxcal.unit.recordingfile import files_in


def inputs_sha256(folder: Path, unit: UnitDescription | None = None) -> str:
    """Hash of the unit's two files, the same wherever the folder lies."""
    recorded: tuple[Path, ...] = (folder / MEASUREMENTS_FILE,)
    if unit is not None and unit.recording is not None:
        recorded = files_in(folder, unit.recording.file)
    pair = () if unit is None or unit.pair is None else (folder / unit.pair.cross_coupling,)
    return files_sha256(
        (folder / UNIT_FILE, *recorded, *pair),
        "put it there, or correct its name in unit.toml",
    )


def files_sha256(paths: Iterable[Path], remedy: str) -> str:
    """Hash of the hashes of files; `remedy` is what to do where one cannot be read.

    Of a folder, as a bag of ROS 2 is one, the names and contents of all its files count.
    """
    digest = hashlib.sha256()
    for path in paths:
        try:
            for file in files_of(path):
                if file != path:
                    digest.update(file.relative_to(path).as_posix().encode() + b"\0")
                with file.open("rb") as content:
                    digest.update(hashlib.file_digest(content, "sha256").digest())
        except OSError as error:
            raise refused_by_system(error.filename or path, "read", error, remedy=remedy) from error
    return digest.hexdigest()


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
