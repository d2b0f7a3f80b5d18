"""rig.toml, read."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Values, each_of
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.buslookup import Described
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.lines import MOST_COLUMNS, LineFormat
from triaxcal.rig.description.resolve import resolved
from triaxcal.rig.description.rigkeys import MessageKeys, RigKeys, SignalKeys, rig_file
from triaxcal.rig.description.shippedrigs import descriptions_folder


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
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    lines = _lines(path, tables)
    files: list[Described] = []
    if lines is not None:
        files.append(_LineFile(path, sha256, lines))
    elif bus_file is None and keys.file is None:
        raise tables["rig"].missing("file", "a bus description, or a table [lines]")
    else:
        first = bus_file or path.parent / str(keys.file)
        more = (path.parent / name for name in keys.more_files)
        files += [read_bus_file(file) for file in (first, *more)]
    named = path.parent.parent == descriptions_folder()
    name = path.parent.name if named else str(path)
    made = resolved(name, str(path), sha256, files, signals, messages, keys.channel)
    return replace(made, lines=lines)


def _lines(path: Path, tables: Mapping[str, Values]) -> LineFormat | None:
    """Format of lines; None where the file has none."""
    if not tables["lines"]:
        return None
    if tables["rig"]:
        raise RefusedError(
            f"{path}, [rig]",
            "stands beside [lines]",
            expected="one of them: a rig sends frames or lines",
        )
    lines = tables["lines"].record(LineFormat)
    used = lines.used
    if len(used) > MOST_COLUMNS or len(set(used)) < len(used):
        raise tables["lines"].refuse("columns", f"at most {MOST_COLUMNS} different names")
    for key in ("integers", "counters"):
        strange = [name for name in getattr(lines, key) if name not in used]
        if strange:
            raise tables["lines"].refuse(key, f"names of columns; {strange[0]} is none")
    return lines


@dataclass(frozen=True)
class _LineFile:
    """The table [lines] as what describes messages."""

    path: Path
    sha256: str
    lines: LineFormat
    warnings: tuple[str, ...] = ()

    def layouts(self) -> tuple[FrameLayout, ...]:
        """The one message."""
        return (self.lines.layout,)
