"""triaxcal poses: which poses are found in a unit's recording, and why others are not."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, UnitFolder, example, say


@click.command(epilog=example("triaxcal poses MPU-1 --picture poses.svg"))
@click.argument("unit", type=UnitFolder())
@PICTURE
def poses(unit: Path, picture: Path | None) -> None:
    """List the poses in a recording, and the stretches refused.

    The unit.toml of UNIT has a table [recording].
    """
    from triaxcal.cli.recorded import recorded, write_picture  # noqa: PLC0415
    from triaxcal.poses.poses import find_poses  # noqa: PLC0415
    from triaxcal.report.studies import poses_picture, poses_text  # noqa: PLC0415

    layout, samples = recorded(unit)
    found = find_poses(samples, layout)
    if picture is not None:
        write_picture(picture, poses_picture(samples, found, layout))
    say(poses_text(found, layout))
