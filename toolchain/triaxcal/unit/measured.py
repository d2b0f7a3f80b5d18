"""When, where and on which rig a unit was measured: [measured] in unit.toml, all optional."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import DATE, line, span


@dataclass(frozen=True)
class Measured:
    """[measured]: when, where and on which rig the unit was measured.

    None if the file does not state it.

    Attributes
    ----------
    rig
        Name of the rig; a series compares its runs.
    date
        Day of the measurements, without quotes.
    place
        Room or site of the measurements.
    operator
        Who measured.
    ambient_degc
        Lowest and highest temperature of the room.
    humidity_percent
        Lowest and highest relative humidity of the room.
    pressure_hpa
        Lowest and highest pressure of the air.
    """

    rig: str | None = setting(line(64), None, example='"tilter 3"')
    date: datetime.date | None = setting(DATE, None, example="2026-03-30")
    place: str | None = setting(line(200), None, example='"room 12"')
    operator: str | None = setting(line(200), None, example='"C. Person"')
    ambient_degc: tuple[float, float] | None = setting(
        span(-100.0, 100.0), None, "degC", example="[22, 24]"
    )
    humidity_percent: tuple[float, float] | None = setting(
        span(0.0, 100.0), None, "%", example="[35, 50]"
    )
    pressure_hpa: tuple[float, float] | None = setting(
        span(300.0, 1200.0), None, "hPa", example="[1008, 1013]"
    )

    @property
    def run(self) -> str | None:
        """Rig and day in words; None when neither is known."""
        return " ".join(str(part) for part in (self.rig, self.date) if part) or None


MEASURED = TableKeys.of(Measured)
