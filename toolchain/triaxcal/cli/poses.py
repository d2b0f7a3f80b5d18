"""triaxcal poses: which poses are found in a unit's recording, and why others are not."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("unit", type=click.Path(path_type=Path))
@click.option("--picture", type=click.Path(path_type=Path), help="Also draw them into this SVG.")
def poses(unit: Path, picture: Path | None) -> None:
    """Show the poses in the recording of UNIT, a folder with unit.toml."""
    from triaxcal.cli.recorded import recorded, write_picture  # noqa: PLC0415
    from triaxcal.poses.poses import find_poses  # noqa: PLC0415
    from triaxcal.report.studies import poses_picture, poses_text  # noqa: PLC0415

    layout, samples = recorded(unit)
    found = find_poses(samples, layout)
    if picture is not None:
        write_picture(picture, poses_picture(samples, found, layout))
    click.echo(poses_text(found, layout))
