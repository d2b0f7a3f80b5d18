"""What the laboratory states of a calibration, key by key, in no language.

Passport, JSON and certificate take it from here. The tables of keys are walked, so that a key that
is added to one of them is stated as well.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from triaxcal.base.keys import TableKeys
from triaxcal.unit.certificate import CERTIFICATE
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.equipment import EQUIPMENT, days_of, overdue
from triaxcal.unit.measured import MEASURED

Value = str | float | datetime.date | tuple[float, float]

OVERDUE, NO_CERTIFICATE, NOT_TRACEABLE, NO_EQUIPMENT, NO_DAY, UPDATED = (
    "overdue", "no certificate", "not traceable", "no equipment", "no day", "updated",
)  # fmt: skip
"""What is half filled, or does not fit together, and is not refused."""


@dataclass(frozen=True)
class Statement:
    """One key and what the laboratory states under it.

    Attributes
    ----------
    table, key : str
        As in unit.toml.
    value : text, number, date, lowest and highest of a quantity, or None
        None is not stated.
    unit : str
        Of the value; "" for none.
    number : int
        Of the table, where the file has several; else 0.
    """

    table: str
    key: str
    value: Value | None
    unit: str = ""
    number: int = 0

    @property
    def name(self) -> str:
        """Table and key, as "measured.rig"."""
        return f"{self.table}.{self.key}"

    @property
    def json(self) -> Any:
        """The value as JSON has it."""
        if isinstance(self.value, datetime.date):
            return self.value.isoformat()
        return list(self.value) if isinstance(self.value, tuple) else self.value


@dataclass(frozen=True)
class Caution:
    """Something that is half filled or does not fit together.

    Attributes
    ----------
    kind : str
        One of the words above.
    subject : str
        Of which instrument; "" for all.
    dates : tuple of dates
        When it was due, and the last day of the measurements.
    """

    kind: str
    subject: str = ""
    dates: tuple[datetime.date, ...] = ()


def statements(unit: UnitDescription) -> tuple[Statement, ...]:
    """Every key of [certificate] and [measured], and those of each [[equipment]], in order."""
    found = [*statements_of(CERTIFICATE, unit.certificate)]
    found += statements_of(MEASURED, unit.measured)
    for number, one in enumerate(unit.equipment, 1):
        found += statements_of(EQUIPMENT, one, number)
    return tuple(found)


def statements_of(table: TableKeys, record: object | None, number: int = 0) -> Iterator[Statement]:
    """Every key of a table, with the values of its record; None is a table that is not there."""
    for key in table.keys:
        value = None if record is None else getattr(record, key.name)
        yield Statement(table.name, key.name, value, key.unit, number)


def cautions(unit: UnitDescription, *, updated: bool = False) -> tuple[Caution, ...]:
    """What a reader should know of what is stated; `updated` in the field after it was."""
    stated = unit.certificate is not None or unit.measured.date is not None
    of_update = [Caution(UPDATED)] if updated and stated else []
    return (*of_update, *_cautions(unit))


def _cautions(unit: UnitDescription) -> Iterator[Caution]:
    days = days_of(unit.measured, unit.certificate)
    if unit.certificate is not None and not unit.equipment:
        yield Caution(NO_EQUIPMENT)
    if unit.equipment and days.last is None:
        yield Caution(NO_DAY)
    for one in unit.equipment:
        if overdue(one, days) and one.due is not None and days.last is not None:
            yield Caution(OVERDUE, one.name, (one.due, days.last))
        if one.certificate is None or one.calibrated is None:
            yield Caution(NO_CERTIFICATE, one.name)
        elif one.traceable_to is None:
            yield Caution(NOT_TRACEABLE, one.name)


def stated_json(unit: UnitDescription) -> dict[str, Any]:
    """What is stated, by table and key; null is not stated."""
    tables: dict[str, Any] = {CERTIFICATE.name: {}, MEASURED.name: {}, EQUIPMENT.name: []}
    tables[EQUIPMENT.name] = [{} for _ in unit.equipment]
    for s in statements(unit):
        target = tables[s.table][s.number - 1] if s.number else tables[s.table]
        target[s.key] = s.json
    return tables
