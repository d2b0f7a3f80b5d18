"""Hashes of the files that a calibration is made of."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from triaxcal.base.errors import refused_by_system
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.folder import UNIT_FILE


def inputs_sha256(folder: Path, unit: UnitDescription | None = None) -> str:
    """Hash of the unit's two files, the same wherever the folder lies."""
    recorded = MEASUREMENTS_FILE
    if unit is not None and unit.recording is not None:
        recorded = unit.recording.file
    pair = () if unit is None or unit.pair is None else (folder / unit.pair.cross_coupling,)
    return files_sha256(
        (folder / UNIT_FILE, folder / recorded, *pair),
        "put it there, or correct its name in unit.toml",
    )


def files_sha256(paths: Iterable[Path], remedy: str) -> str:
    """Hash of the hashes of files; `remedy` is what to do where one cannot be read.

    Of a folder, as a bag of ROS 2 is one, all its files count.
    """
    digest = hashlib.sha256()
    for path in (f for p in paths for f in (sorted(p.iterdir()) if p.is_dir() else (p,))):
        try:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            raise refused_by_system(path, "read", error, remedy=remedy) from error
    return digest.hexdigest()
