"""The list of a series: every unit that was named, with its passport or why it has none."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from triaxcal.batch.run import Series
from triaxcal.delivery.verdict import PASSED, REFUSED
from triaxcal.report.texts.csvlink import csv_link
from triaxcal.report.words.numbers import significant

SKIPPED = "not in the series"
"""Verdict of what a series leaves to another command."""
PASSPORT, IMU_PAGE = "passport.html", "dynamic.html"
_WHERE = (("T0", "at T0"), ("range", "over the range"))
_UNKNOWN_KIND = {True: "tilter", False: "recording"}
"""Of records that do not state it: whether there is a placement pattern."""


@dataclass(frozen=True)
class Cell:
    """What stands in the list, and by what it is sorted: a number, or the text itself."""

    text: str
    key: float | None = None

    @property
    def attribute(self) -> str:
        """The number that it is sorted by."""
        return "" if self.key is None else f"{self.key:.9g}"


@dataclass(frozen=True)
class Row:
    """One unit.

    Attributes
    ----------
    unit, serial, kind, result, why, model, rig, date : str
        `why` is empty where `result` is "passed".
    href : str
        Its page, relative to that of the series; empty where there is none.
    errors : tuple of Cell
        Largest error at T0 and over the range, and the latter with its uncertainty.
    errors_g : tuple
        The same in g, None where there is none.
    """

    unit: str
    result: str
    why: str = ""
    href: str = ""
    serial: str = ""
    kind: str = ""
    errors: tuple[Cell, ...] = (Cell(""), Cell(""), Cell(""))
    errors_g: tuple[float | None, ...] = (None, None, None)
    model: str = ""
    rig: str = ""
    date: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing has to be said."""
        return self.result == PASSED


def rows_of(series: Series, build: Path | None = None) -> list[Row]:
    """All units by name: delivered, refused, and those that the series does not make.

    `build` is where their pages are, for units that another command has delivered.
    """
    found = [_made(record) for record in series.records]
    found += [Row(name, REFUSED, why) for name, why in series.refused.items()]
    found += [_skipped(name, why, build) for name, why in series.skipped.items()]
    return sorted(found, key=lambda row: row.unit)


def _made(record: dict[str, Any]) -> Row:
    imu = "states" in record
    errors = _errors_g(record)
    return Row(
        unit=record["unit"],
        result=record["result"],
        why="" if record["result"] == PASSED else record["verdict"],
        href=href(record["unit"], IMU_PAGE if imu else PASSPORT),
        serial=record["serial"],
        kind=record.get("kind") or _UNKNOWN_KIND[record["placement_pattern_g"] is not None],
        errors=tuple(Cell("") if e is None else Cell(significant(1e3 * e, 3), e) for e in errors),
        errors_g=errors,
        model=f"{len(record['states'])} states" if imu else record["thermal_model"],
        rig=record["rig"] or "",
        date=record["date"] or "",
    )


def _skipped(name: str, why: str, build: Path | None) -> Row:
    has_page = build is not None and (build / name / IMU_PAGE).is_file()
    return Row(name, SKIPPED, why, href(name, IMU_PAGE) if has_page else "", kind="IMU")


def _errors_g(record: dict[str, Any]) -> tuple[float | None, ...]:
    found = {a["where"]: a for a in record.get("acceptance", ())}
    largest = [
        found[where]["largest_residual_g"] if where in found else None for _, where in _WHERE
    ]
    whole = found.get(_WHERE[1][1])
    reach = None
    if whole is not None:
        reach = whole["largest_residual_g"] + whole["expanded_uncertainty_g"]
    return (*largest, reach)


def href(name: str, page: str) -> str:
    """Address of a unit's page, relative to the series': it moves with the folder."""
    return f"./{quote(os.fsencode(name), safe='')}/{page}"


def units_csv(rows: Iterable[Row]) -> str:
    """The list as a link with the file in it."""
    head = (
        "unit", "serial", "kind", "verdict", "why", "largest_error_t0_g", "largest_error_range_g",
        "with_uncertainty_range_g", "thermal_model", "rig", "date", "page",
    )  # fmt: skip
    lines = [
        (r.unit, r.serial, r.kind, r.result, r.why, *r.errors_g, r.model, r.rig, r.date, r.href)
        for r in rows
    ]
    return csv_link([head, *lines])
