"""When and on which rig a unit was measured: [measured] in unit.toml, both optional."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, key, keys_of
from triaxcal.base.kinds import DATE, line


@dataclass(frozen=True)
class Measured:
    """Rig and day of the measurements; None where the file does not say."""

    rig: str | None = key(
        line(64), "Name of the rig; a series compares its runs.", None, example='"tilter 3"'
    )
    date: datetime.date | None = key(
        DATE, "Day of the measurements, without quotes.", None, example="2026-03-30"
    )

    @property
    def run(self) -> str | None:
        """Rig and day in words; None when neither is known."""
        return " ".join(str(part) for part in (self.rig, self.date) if part) or None


MEASURED = TableKeys("measured", "When and on which rig the unit was measured.", keys_of(Measured))
