"""What a unit was measured with: the tables [[equipment]] of unit.toml, and their dates."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import DATE, line
from triaxcal.unit.certificate import CertificateDetails
from triaxcal.unit.measured import Measured


@dataclass(frozen=True)
class Equipment:
    """[[equipment]]: an instrument that the unit was measured with, a table for each.

    Attributes
    ----------
    name
        What it is.
    manufacturer
        Who made it.
    model
        The manufacturer's name of its type.
    serial
        Its serial number.
    certificate
        Number of its own calibration certificate.
    calibrated
        Day of its own calibration.
    due
        Day on which its next calibration is due.
    traceable_to
        To which standard its calibration is traceable, and by whom.
    """

    name: str = setting(line(200), example='"dividing head"')
    manufacturer: str | None = setting(line(200), None, example='"Manufacturer"')
    model: str | None = setting(line(200), None, example='"Type 2"')
    serial: str | None = setting(line(200), None, example='"0042"')
    certificate: str | None = setting(line(200), None, example='"D-K-17"')
    calibrated: datetime.date | None = setting(DATE, None, example="2025-11-03")
    due: datetime.date | None = setting(DATE, None, example="2026-11-03")
    traceable_to: str | None = setting(line(200), None, example='"national metrology institute"')


EQUIPMENT = TableKeys.of(Equipment)


@dataclass(frozen=True)
class Days:
    """First and last day of the measurements, and the keys that state them; None if unknown."""

    first: datetime.date | None
    last: datetime.date | None
    key_of_first: str
    key_of_last: str


def days_of(measured: Measured, details: CertificateDetails | None) -> Days:
    """Days of the measurements, by [certificate] or else by [measured]."""
    if details is not None:
        return Days(details.begin, details.end, "[certificate] begin", "[certificate] end")
    return Days(measured.date, measured.date, "[measured] date", "[measured] date")


def equipment_of(tables: Sequence[Values], days: Days) -> tuple[Equipment, ...]:
    """The equipment, in the order of the file.

    Raises
    ------
    RefusedError
        When its next calibration is due before its last one, that was after the measurements, or
        two tables state the same instrument. One that is overdue is not refused: `overdue` says it.
    """
    found: list[Equipment] = []
    for values in tables:
        one = values.record(Equipment)
        if one.calibrated is not None:
            if one.due is not None and one.due < one.calibrated:
                raise values.refuse("due", f"{one.calibrated} (calibrated) or later")
            if days.last is not None and one.calibrated > days.last:
                raise values.refuse(
                    "calibrated",
                    f"{days.last} ({days.key_of_last}) or earlier",
                    "state the calibration that was valid at the measurements",
                )
        if one in found:
            raise values.refuse(
                "name", "another instrument than number "
                f"{found.index(one) + 1}, whose keys are the same", "remove one"
            )  # fmt: skip
        found.append(one)
    return tuple(found)


def overdue(equipment: Equipment, days: Days) -> bool:
    """Whether its next calibration was due before the last day of the measurements."""
    return equipment.due is not None and days.last is not None and equipment.due < days.last


def refuse_other_day(
    values: Values, measured: Measured, details: CertificateDetails | None
) -> None:
    """Refuse a day of [measured] that is none of those of [certificate].

    Raises
    ------
    RefusedError
        Names both.
    """
    if measured.date is None or details is None:
        return
    if not details.begin <= measured.date <= details.end:
        raise values.refuse(
            "date",
            f"a day from {details.begin} to {details.end}, as [certificate] begin and end say",
        )
