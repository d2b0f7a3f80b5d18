"""`triaxcal dynamic`: a whole IMU from a recording on a turntable."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.termui import progressbar

if TYPE_CHECKING:
    from triaxcal.imudelivery import ImuDelivery


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
    calibrate_imu(unit, build)


def calibrate_imu(unit: Path, build: Path) -> None:
    """Do the work of `triaxcal dynamic`, and of `triaxcal calib` for a unit with [dynamic]."""
    from triaxcal.publish import publish  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files, dynamic_summary  # noqa: PLC0415
    from triaxcal.report.imuc import C_FILES  # noqa: PLC0415

    made = delivered_imu(unit)
    files = dynamic_files(made)
    target = build / made.done.unit.name
    publish(files, target, C_FILES)
    click.echo(dynamic_summary(made, files, str(target)))


def delivered_imu(unit: Path) -> ImuDelivery:
    """Calibrate the IMU and make its C, with a bar of progress."""
    from triaxcal.imudelivery import deliver_imu  # noqa: PLC0415

    with ExitStack() as stack:
        bars: list[Any] = []

        def progress(step: str, part: float) -> None:
            if not bars:  # nothing is drawn for what is refused at the door
                bars.append(
                    stack.enter_context(progressbar(length=1000, label=step, file=sys.stderr))
                )
            bar = bars[0]
            if bar.label != step:
                bar.label = step
                bar.pos = 0
            bar.update(max(0, round(1000 * part) - bar.pos))

        return deliver_imu(unit, progress)
