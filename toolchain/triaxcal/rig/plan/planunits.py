"""[unit.NAME] of a plan: the units that one session measures together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Values, each_of, setting
from triaxcal.base.kinds import line, whole

MOST_UNITS = 32
_ID_MAX = 0x1FFF_FFFF


@dataclass(frozen=True, kw_only=True)
class UnitKeys:
    """[unit.UNIT]: a unit that is measured together with others, named after its folder.

    Attributes
    ----------
    folder
        Folder of the unit, relative to the plan.
    serial
        Serial number that unit.toml must have.
    bus
        Where its frames come from, as --bus has it.
    rig
        Its rig description, where it is another one than that of [rig].
    id_offset
        Added to the IDs of the rig description.
    source_address
        J1939 source address, in place of that of the rig description.
    """

    folder: str | None = setting(line(), None, words="units/UNIT", example='"units/AT-7"')
    serial: str | None = setting(line(), None, words="any", example='"SN-0007"')
    bus: str | None = setting(line(), None, words="that of --bus", example='"can0"')
    rig: str | None = setting(line(), None, words="that of [rig]", example='"tilter"')
    id_offset: int = setting(whole(-_ID_MAX, _ID_MAX), 0)
    source_address: int | None = setting(
        whole(0, 253), None, words="that of the rig description", example="128"
    )


def planned_units(source: str, tables: Mapping[str, Values]) -> Mapping[str, UnitKeys]:
    """Units that a plan lists, by name; none in the plan of one unit.

    Raises
    ------
    RefusedError
        When there are too many.
    """
    units = {name: values.record(UnitKeys) for name, values in each_of(tables, "unit").items()}
    if len(units) > MOST_UNITS:
        raise RefusedError(
            source,
            f"lists {len(units)} units",
            expected=f"at most {MOST_UNITS}",
            remedy="make two sessions of it",
        )
    return units
