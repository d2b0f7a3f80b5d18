"""triaxcal poses: which poses are found in a unit's recording, and why others are not."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, UnitFolder, command, example, show


@command(epilog=example("triaxcal poses MPU-1 --picture poses.svg"))
@click.argument("unit", type=UnitFolder())
@PICTURE
def poses(unit: Path, picture: Path | None) -> None:
    """List the poses in a recording, and the stretches refused.

    The unit.toml of UNIT has a table [recording].
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.find_poses(triaxcal.read_unit(unit)), picture)
