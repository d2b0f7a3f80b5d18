"""The folders of units: names, serial numbers, and what is there."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import DESCRIPTION, FORMAT, Key, TableKeys
from triaxcal.base.kinds import pattern
from triaxcal.base.shipped import shipped
from triaxcal.base.tomltable import did_you_mean, read_toml, shown

UNIT_FILE, UNIT_FORMAT = "unit.toml", 1
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", re.ASCII)
_DEVICE = re.compile(r"(?i:con|prn|aux|nul|com[0-9]|lpt[0-9])")
"""Windows makes no folder of such a name."""
_NAME_RULE = "1 to 64 of A-Z a-z 0-9 - _, the first a letter or digit"

SERIAL = Key(
    "serial",
    pattern(_NAME.pattern, f"text in quotes, {_NAME_RULE}", '"SN-0001"'),
    "Serial number; no two units in one folder may share it.",
)
TOP = TableKeys("", "The unit.", (FORMAT, SERIAL, DESCRIPTION))


def check_unit_name(name: str, where: str = "unit name") -> None:
    """Refuse a name of a unit, or a serial number, that is unfit for folders and C comments.

    Raises
    ------
    RefusedError
        Unless it is 1 to 64 ASCII letters, digits, '-' and '_', the first a letter or digit, and
        not the name of a device of Windows.
    """
    if not _NAME.fullmatch(name):
        raise RefusedError(where, f"found {shown(name)}", expected=_NAME_RULE)
    if _DEVICE.fullmatch(name):
        raise RefusedError(
            where, f"found {shown(name)}, a device of Windows", remedy="choose another name"
        )


def list_units(units_dir: Path) -> list[str]:
    """Names of the units in a folder, sorted; none when there is no such folder."""
    try:
        names = sorted(entry.name for entry in units_dir.iterdir())
    except OSError:
        return []
    return [name for name in names if _NAME.fullmatch(name) and _is_unit(units_dir / name)]


def find_unit(folder: Path) -> Path:
    """Path of the unit.toml in a unit's folder.

    Raises
    ------
    RefusedError
        When the name is unfit, a '..' follows a named folder, or the folder has no unit.toml;
        names the units that there are.
    """
    if any(b == ".." and a != ".." for a, b in pairwise(folder.parts)):
        raise RefusedError(str(folder), "'..' in the name of a unit", expected=_NAME_RULE)
    check_unit_name(folder.absolute().name, f"unit {shown(str(folder))}")
    if _is_unit(folder):
        _refuse_other_case(folder)
        return folder / UNIT_FILE
    _refuse_made_files(folder)
    hint = ""
    for units_dir in (folder, folder.parent, folder.parent.parent):
        if names := list_units(units_dir):
            more = f" and {len(names) - 20} more" if len(names) > 20 else ""
            remedy = f"units in {units_dir}: " + ", ".join(names[:20]) + more
            hint = did_you_mean(folder.name, names) if units_dir == folder.parent else ""
            break
    else:
        remedy = f"`triaxcal init {folder}` writes a first unit.toml"
        if _is_unit(shipped("units") / folder.name) and not folder.exists():
            remedy = f"`triaxcal example {folder.name}` copies the example"
    found = f"no {UNIT_FILE} in it" if folder.is_dir() else f"no such unit{hint}"
    raise RefusedError(str(folder), found, remedy=remedy)


def _refuse_other_case(folder: Path) -> None:
    """Windows and macOS find sn-1 where SN-1 is: results of one unit would get two names."""
    path = folder.absolute()
    if not _is_unit(path.with_name(path.name.swapcase())):
        return
    names = list_units(path.parent)
    if path.name not in names:
        same = [name for name in names if name.lower() == path.name.lower()]
        raise RefusedError(
            str(folder), "no such unit by upper and lower case", expected=", ".join(same)
        )


def _refuse_made_files(folder: Path) -> None:
    """What was made of a unit, as by `firmware --prefix`, is no unit: another one is no help."""
    made = [p for pattern in ("*_calib.h", "include/*_calib.h") for p in folder.glob(pattern)]
    if made:
        first = min((path.name for path in made), key=len)
        raise RefusedError(
            str(folder),
            f"no {UNIT_FILE} in it, but {first}: files that were made of a unit",
            expected="that unit, or its delivered folder",
            remedy="name it; where the command has --prefix, this folder has the C of --prefix "
            + first.removesuffix("_calib.h"),
        )


def _is_unit(folder: Path) -> bool:
    try:
        return (folder / UNIT_FILE).is_file()
    except OSError:  # a folder that may not be entered
        return False


def refuse_duplicate_serial(folder: Path, serial: str) -> None:
    """Refuse a serial number that another unit beside this one has.

    Raises
    ------
    RefusedError
        Names the other unit.
    """
    units_dir = folder.absolute().parent
    for name in list_units(units_dir):
        other = units_dir / name
        if not other.samefile(folder) and _serial_leniently(other / UNIT_FILE, serial) == serial:
            raise RefusedError(
                f"{folder / UNIT_FILE}, serial",
                f'"{serial}" is also the serial of {folder.parent / name}',
                expected="a serial number of its own for each unit",
                remedy="correct one of the two",
            )


def _serial_leniently(path: Path, serial: str) -> object:
    """Serial in another unit's file; None when unreadable, or when `serial` is nowhere in it.

    A broken neighbour must not block this unit, and a thousand neighbours must not cost a
    thousand parses.
    """
    try:
        if serial.encode() not in path.read_bytes():
            return None
        return read_toml(path).get("serial")
    except (OSError, RefusedError):
        return None
