"""`triaxcal diagnose`: which cause explains a unit's readings."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import UnitFolder, command, example, say


@command(epilog=example("triaxcal diagnose AT-SIM"))
@click.argument("unit", type=UnitFolder())
def diagnose(unit: Path) -> None:
    """Rank the causes that could explain a unit's readings.

    UNIT is a unit on a tilter, or one with a recording of poses. Wrong dwells or poses, misplaced
    or exchanged positions, hysteresis, drift, mistaken temperatures, a dead output and others
    compete; `ln odds` is the logarithm of the odds of each against a sound unit.
    """
    import triaxcal  # noqa: PLC0415

    say(str(triaxcal.diagnose(triaxcal.read_unit(unit))))
