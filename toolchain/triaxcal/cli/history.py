"""`triaxcal history`: a unit's calibrations over time."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import DELIVERED, UnitFolder, command, example, show


@command(epilog=example("triaxcal history AT-0042"))
@click.argument("unit", type=UnitFolder())
@DELIVERED
def history(unit: Path, build: Path) -> None:
    """Compare the calibrations of a unit over time.

    UNIT has earlier readings in history/, whose names are dates, beside its own; or earlier
    calibration.json files. An update in build/UNIT comes last.
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.compare_history(triaxcal.read_unit(unit), build))
