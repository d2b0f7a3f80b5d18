"""What a session of many units is about: each has a rig description with IDs of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.plan.plan import SessionPlan, list_planned, read_plan
from triaxcal.rig.plan.planunits import UnitKeys
from triaxcal.rig.session.engine import Setup
from triaxcal.unit.description import read_unit
from triaxcal.unit.folder import find_unit

_STANDARD_IDS, _EXTENDED_IDS = 1 << 11, 1 << 29


@dataclass(frozen=True)
class Place:
    """One unit of a session of many.

    Attributes
    ----------
    bus : str
        Where its frames come from.
    """

    name: str
    bus: str
    setup: Setup


@dataclass(frozen=True)
class ManySetup:
    """A session of many units: one plan, one chamber, one tilter."""

    source: str
    places: tuple[Place, ...]

    @property
    def plan(self) -> SessionPlan:
        """Plan; what it says of the steps is the same for all units."""
        return self.places[0].setup.plan

    @property
    def sessions(self) -> Path:
        """Folder of the sessions, beside the plan."""
        path = Path(self.source)
        return path.with_name(f"{path.stem}-sessions")

    @property
    def buses(self) -> tuple[str, ...]:
        """Buses, each once."""
        return tuple(dict.fromkeys(place.bus for place in self.places))


def one_of_plan(path: Path, name: str, dbc: Path | None = None) -> Setup:
    """Setup of one of the units that a plan lists.

    Raises
    ------
    RefusedError
        As `many_of_plan`.
    """
    planned = list_planned(path)
    if name not in planned:
        raise RefusedError(
            str(path),
            f"lists no unit {name}{did_you_mean(name, planned)}",
            expected="one of " + ", ".join(planned),
        )
    return _setup(path, name, planned[name], dbc)


def many_of_plan(path: Path, bus: str = "", dbc: Path | None = None) -> ManySetup:
    """Setup of all units that a plan lists.

    Parameters
    ----------
    bus : str
        Of the units for which the plan names none.

    Raises
    ------
    RefusedError
        When a file breaks a rule, a unit has no bus, or two of them cannot be told apart.
    """
    places = []
    for name, keys in list_planned(path).items():
        where = keys.bus or bus
        if not where:
            raise RefusedError(
                f"{path}, [unit.{name}] bus", "missing", expected="a bus here, or --bus"
            )
        places.append(Place(name, where, _setup(path, name, keys, dbc)))
    _refuse_twins(path, places)
    return ManySetup(str(path), tuple(places))


def _setup(path: Path, name: str, keys: UnitKeys, dbc: Path | None) -> Setup:
    folder = path.parent / keys.folder if keys.folder is not None else Path("units") / name
    find_unit(folder)
    unit = read_unit(folder)
    place = f"{path}, [unit.{name}]"
    if keys.serial is not None and keys.serial != unit.serial:
        raise RefusedError(
            f"{place} serial", f"found {keys.serial}", expected=f"{unit.serial}, as {unit.source}"
        )
    plan = read_plan(path, unit)
    rig_file = plan.rig if keys.rig is None else find_description(keys.rig, path.parent)
    rig = _moved(place, keys, read_description(rig_file, dbc))
    setup = Setup(folder, unit, replace(plan, rig=rig_file), rig)
    setup.refuse_unfit()
    return setup


def _moved(place: str, keys: UnitKeys, rig: RigDescription) -> RigDescription:
    """Description of the unit's own IDs."""
    j1939 = {use.layout.j1939 for use in rig.messages.values()}
    for key, wanted, kind in (
        ("id_offset", keys.id_offset != 0, False),
        ("source_address", keys.source_address is not None, True),
    ):
        if wanted and kind not in j1939:
            other = "J1939's" if not kind else "not J1939's"
            raise RefusedError(
                f"{place} {key}",
                f"given, and all IDs of {rig.name} are {other}",
                expected="source_address" if not kind else "id_offset",
            )
    moved = rig.moved(keys.id_offset, keys.source_address)
    for use in moved.messages.values():
        layout = use.layout
        end = _EXTENDED_IDS if layout.extended else _STANDARD_IDS
        if not 0 <= layout.frame_id < end:
            raise RefusedError(
                f"{place} id_offset",
                f"found {keys.id_offset}: the ID of {layout.name} becomes {layout.frame_id:#x}",
                expected=f"IDs from 0x0 to {end - 1:#x}",
            )
    return moved


def _refuse_twins(path: Path, places: Sequence[Place]) -> None:
    """Refuse units that are one, or whose frames are."""
    for one, other in combinations(places, 2):
        both = f"{one.name} and {other.name}"
        if one.setup.folder.resolve() == other.setup.folder.resolve():
            raise RefusedError(str(path), f"{both} have the same folder, {one.setup.folder}")
        if one.setup.unit.serial == other.setup.unit.serial:
            raise RefusedError(
                str(path), f"{both} have the same serial number, {one.setup.unit.serial}"
            )
        if one.bus != other.bus:
            continue
        for a in one.setup.rig.messages.values():
            for b in other.setup.rig.messages.values():
                if a.layout.overlaps(b.layout):
                    raise RefusedError(
                        f"{path}, [unit.{other.name}]",
                        f"{both} have the same IDs on {one.bus}: {a.name} {a.layout.can_id:#x} "
                        f"and {b.name} {b.layout.can_id:#x}",
                        expected="IDs of its own for each unit of a bus",
                        remedy="state id_offset, source_address, another rig or another bus",
                    )
