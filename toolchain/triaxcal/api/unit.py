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

    Raises
    ------
    RefusedError
        When a key is missing, unknown, of a wrong type or out of its range.
    """

    def __init__(self, name: str, *, serial: str, **tables: Any) -> None:
        text = toml_text({"format": UNIT_FORMAT, "serial": serial, **tables})
        self._description = unit_of_text(name, text, f"Unit({name!r})")
        self._folder: Path | None = None

    @classmethod
    def of(cls, description: UnitDescription, folder: Path | None) -> Unit:
        """Unit of a description that has been read."""
        unit = cls.__new__(cls)
        unit._description, unit._folder = description, folder
        return unit

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self._description.name

    @property
    def serial(self) -> str:
        """Serial number."""
        return self._description.serial

    @property
    def toml(self) -> str:
        """Text of unit.toml."""
        return self._description.toml

    @property
    def description(self) -> UnitDescription:
        """Everything, validated."""
        return self._description

    @property
    def folder(self) -> Path | None:
        """Where it was read."""
        return self._folder

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
            remedy=f"`triaxcal dynamic {path}` says what the recording of an IMU shows; in Python, "
            "triaxcal.read_imu",
        )
    return Unit.of(read_description(path), path)
