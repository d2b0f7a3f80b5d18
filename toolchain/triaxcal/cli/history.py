"""`triaxcal history`: a unit's calibrations over time."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import UnitFolder, example, say
from triaxcal.report.history import history_text
from triaxcal.uncertainty.history import (
    changes,
    read_history,
    repeatability,
)
from triaxcal.unit.description import read_unit


@click.command(epilog=example("triaxcal history AT-0042"))
@click.argument("unit", type=UnitFolder())
def history(unit: Path) -> None:
    """Compare the calibrations of a unit over time.

    UNIT has earlier readings as history/*.csv, whose names are dates, beside measurements.csv.
    """
    description = read_unit(unit)
    found = read_history(unit, description)
    say(
        history_text(
            description.serial,
            found,
            changes(description, found),
            repeatability(description, found),
        )
    )
