"""`triaxcal history`: a unit's calibrations over time."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import UnitFolder, command, example, show


@command(epilog=example("triaxcal history AT-0042"))
@click.argument("unit", type=UnitFolder())
def history(unit: Path) -> None:
    """Compare the calibrations of a unit over time.

    UNIT has earlier readings as history/*.csv, whose names are dates, beside measurements.csv.
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.compare_history(triaxcal.read_unit(unit)))
