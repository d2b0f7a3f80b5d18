"""`triaxcal dynamic`: a whole IMU from a recording on a turntable."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from click.termui import progressbar


@click.command()
@click.argument("unit", type=click.Path(path_type=Path))
@click.option(
    "--build",
    type=click.Path(path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder that receives a folder of the unit's name.",
)
def dynamic(unit: Path, build: Path) -> None:
    """Calibrate the IMU UNIT, a folder with unit.toml and a recording on a turntable."""
    from triaxcal.dynamic.unit import calibrate_unit  # noqa: PLC0415
    from triaxcal.publish import publish  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files, dynamic_summary  # noqa: PLC0415

    with progressbar(length=1000, label="pass 1", file=sys.stderr) as bar:

        def progress(step: str, part: float) -> None:
            if bar.label != step:
                bar.label = step
                bar.pos = 0
            bar.update(max(0, round(1000 * part) - bar.pos))

        done = calibrate_unit(unit, progress)
    target = build / done.unit.name
    publish(dynamic_files(done), target)
    click.echo(dynamic_summary(done, str(target)))
