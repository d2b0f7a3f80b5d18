"""rig.toml, read."""

from __future__ import annotations

import hashlib
from pathlib import Path

from triaxcal.base.keys import each_of
from triaxcal.rig.description import RigDescription
from triaxcal.rig.resolve import resolved
from triaxcal.rig.rigkeys import MessageKeys, RigKeys, SignalKeys, rig_file
from triaxcal.rig.shippedrigs import descriptions_folder


def read_description(path: Path, bus_file: Path | None = None) -> RigDescription:
    """Rig description of a rig.toml.

    Parameters
    ----------
    bus_file : Path, optional
        In place of the one that it names.

    Raises
    ------
    RefusedError
        When a file breaks a rule of docs/reference/keys.md, names a signal that the bus
        description lacks, or states what cannot be true of it.
    """
    tables = rig_file().read(path)
    keys, signals = tables["rig"].record(RigKeys), tables["signals"].record(SignalKeys)
    messages = {n: v.record(MessageKeys) for n, v in each_of(tables, "message").items()}
    files = [bus_file or path.parent / keys.file, *(path.parent / f for f in keys.more_files)]
    named = path.parent.parent == descriptions_folder()
    return resolved(
        path.parent.name if named else str(path),
        str(path),
        hashlib.sha256(path.read_bytes()).hexdigest(),
        files,
        signals,
        messages,
    )
