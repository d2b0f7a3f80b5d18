"""When and on which rig a unit was measured: [measured] in unit.toml, both optional."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import DATE, line


@dataclass(frozen=True)
class Measured:
    """[measured]: when and on which rig the unit was measured.

    None if the file does not state it.

    Attributes
    ----------
    rig
        Name of the rig; a series compares its runs.
    date
        Day of the measurements, without quotes.
    """

    rig: str | None = setting(line(64), None, example='"tilter 3"')
    date: datetime.date | None = setting(DATE, None, example="2026-03-30")

    @property
    def run(self) -> str | None:
        """Rig and day in words; None when neither is known."""
        return " ".join(str(part) for part in (self.rig, self.date) if part) or None


MEASURED = TableKeys.of(Measured)
