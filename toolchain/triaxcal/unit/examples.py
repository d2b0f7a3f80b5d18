"""The example units that came with this triaxcal, to be copied and tried."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.publish import publish
from triaxcal.base.shipped import shipped
from triaxcal.base.tomltable import did_you_mean, read_toml
from triaxcal.unit.folder import UNIT_FILE, list_units


@dataclass(frozen=True)
class ExampleUnit:
    """An example unit.

    Attributes
    ----------
    name : str
    description : str
        As its unit.toml says.
    commands : tuple of str
        What to run on it, in order, with "{}" for its folder.
    """

    name: str
    description: str
    commands: tuple[str, ...]


def example_units() -> list[ExampleUnit]:
    """Every example unit, by name."""
    folder = shipped("units")
    return [_example(folder / name) for name in list_units(folder)]


def _example(folder: Path) -> ExampleUnit:
    unit: dict[str, Any] = read_toml(folder / UNIT_FILE)
    simulated = ("triaxcal simulate {}",) if _recording(unit) else ()
    commands = *simulated, "triaxcal calib {}"
    return ExampleUnit(folder.name, str(unit.get("description", "")), commands)


def _recording(unit: dict[str, Any]) -> str | None:
    """File of an IMU's recording: it is large, and made from the truth beside it."""
    name = unit.get("dynamic", {}).get("recording")
    return None if name is None else str(name)


def write_example(name: str, into: Path) -> Path:
    """Copy an example unit into a folder; returns the folder of the unit.

    Raises
    ------
    UsageError
        When there is no such example.
    RefusedError
        When something of that name is there already, or cannot be written.
    """
    known = {example.name: example for example in example_units()}
    if name not in known:
        raise UsageError(
            "example", f"found {name!r}{did_you_mean(name, known)}", expected=", ".join(known)
        )
    target = into / name
    if os.path.lexists(target):
        raise RefusedError(
            str(target),
            "exists already",
            expected="nothing there: no file is overwritten",
            remedy="move it away, or name another folder with --into",
        )
    source = shipped("units") / name
    # In a checkout there may be a recording that was simulated, and sessions.
    recording = _recording(read_toml(source / UNIT_FILE))
    files = (p for p in sorted(source.iterdir()) if p.is_file() and p.name != recording)
    publish({path.name: path.read_bytes() for path in files}, target)
    return target
