"""`read_unit`, `Unit`: the description of one unit, from its folder or from arguments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.base.tomltable import has_table
from triaxcal.base.tomltext import toml_text
from triaxcal.unit.description import UnitDescription, unit_of_text
from triaxcal.unit.description import read_unit as read_description
from triaxcal.unit.folder import UNIT_FILE, UNIT_FORMAT, find_unit


class Unit:
    """One unit, as unit.toml describes it.

    Parameters
    ----------
    name : str
        1 to 64 of A-Z a-z 0-9 - _, the first a letter or digit.
    serial : str
    **tables : mappings
        Tables of unit.toml by name, with the same keys, checks and defaults:
        ``Unit("SN-7", serial="7", adc={"bits": 24, "full_scale_v": 2.5}, ...)``.

    Attributes
    ----------
    name, serial : str
    description : UnitDescription
        Everything, validated.
    toml : str
        The text of unit.toml.
    folder : Path or None
        Where it was read; None for a unit that was made from arguments.

    Raises
    ------
    RefusedError
        When a key is missing, unknown, of a wrong type or out of its range.
    """

    name: str
    serial: str
    description: UnitDescription
    toml: str
    folder: Path | None

    def __init__(self, name: str, *, serial: str, **tables: Any) -> None:
        text = toml_text({"format": UNIT_FORMAT, "serial": serial, **tables})
        self._set(unit_of_text(name, text, f"Unit({name!r})"), text, None)

    @classmethod
    def of(cls, description: UnitDescription, toml: str, folder: Path | None) -> Unit:
        """Unit of a description that has been read."""
        unit = cls.__new__(cls)
        unit._set(description, toml, folder)
        return unit

    def _set(self, description: UnitDescription, toml: str, folder: Path | None) -> None:
        self.name, self.serial = description.name, description.serial
        self.description, self.toml, self.folder = description, toml, folder

    def __repr__(self) -> str:
        return f"<triaxcal.Unit {self.name}, serial {self.serial}>"

    def write(self, folder: str | Path) -> Path:
        """Write unit.toml into a folder, which is made where it is missing.

        Raises
        ------
        RefusedError
            When the folder has a unit.toml, or cannot be written.
        """
        path = Path(folder) / UNIT_FILE
        if path.exists():
            raise RefusedError(
                str(path), "is there already", expected="none", remedy="name another folder"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        renew({UNIT_FILE: self.toml.encode()}, path.parent)
        return path


def read_unit(folder: str | Path) -> Unit:
    """Unit in a folder, from its unit.toml.

    Raises
    ------
    RefusedError
        When there is no such unit, its file breaks a rule, or another unit beside it has the same
        serial number.
    """
    path = Path(folder)
    if has_table(find_unit(path), "dynamic"):
        raise RefusedError(
            f"{path / UNIT_FILE}",
            "a whole IMU, [dynamic]",
            expected="the unit of one accelerometer",
            remedy=f"use read_imu, or `triaxcal dynamic {path}`",
        )
    description = read_description(path)
    return Unit.of(description, (path / UNIT_FILE).read_text(encoding="utf-8-sig"), path)
