"""triaxcal drift: one orientation over temperature, heating against cooling."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, UnitFolder, command, example, show


@command(epilog=example("triaxcal drift MPU-1 --picture drift.svg"))
@click.argument("unit", type=UnitFolder())
@PICTURE
def drift(unit: Path, picture: Path | None) -> None:
    """Compare heating with cooling in one orientation.

    The recording of UNIT is a thermal cycle at rest. Its half-cycles show the hysteresis, and
    whether a term in dT/dt predicts held-out half-cycles better.
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.study_drift(triaxcal.read_unit(unit)), picture)
