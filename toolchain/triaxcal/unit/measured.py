"""When and on which rig a unit was measured: [measured] in unit.toml, both optional."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.tomltable import Table

MEASURED_KEYS = ("rig", "date")
_LONGEST = 64


@dataclass(frozen=True)
class Measured:
    """Rig and day of the measurements; None where the file does not say."""

    rig: str | None = None
    date: datetime.date | None = None

    @property
    def run(self) -> str | None:
        """Rig and day in words; None when neither is known."""
        return " ".join(str(part) for part in (self.rig, self.date) if part) or None


def measured_details(table: Table) -> Measured:
    """Rig and day in a table [measured].

    Raises
    ------
    RefusedError
        When the rig is no short line of text, or the day is no date.
    """
    rig, day = None, None
    if "rig" in table:
        rig = table.text("rig")
        if not rig.strip() or not rig.isprintable() or len(rig) > _LONGEST:
            raise table.refuse("rig", f"a name of 1 to {_LONGEST} printable characters")
    if "date" in table:
        value = table.values["date"]
        if not isinstance(value, datetime.date) or isinstance(value, datetime.datetime):
            raise table.refuse("date", "a day without quotes, as 2026-03-30")
        day = value
    return Measured(rig, day)
