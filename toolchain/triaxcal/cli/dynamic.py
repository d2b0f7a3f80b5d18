"""`triaxcal dynamic`: a whole IMU from a recording on a turntable."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.termui import progressbar

from triaxcal.cli.options import example, say, unit_and_build

if TYPE_CHECKING:
    from triaxcal.delivery.imu import ImuDelivery


@click.command(epilog=example("triaxcal dynamic IMU-SIM", "triaxcal dynamic IMU-SIM --plan"))
@unit_and_build
@click.option(
    "--plan",
    is_flag=True,
    help="Only report what the motion in imu_truth.toml determines; without a recording.",
)
def dynamic(unit: Path, build: Path, plan: bool) -> None:
    """Calibrate a whole IMU from a recording on a turntable.

    The folder UNIT has the recording, and a unit.toml with the table [dynamic].
    """
    if plan:
        tell_plan(unit)
    else:
        calibrate_imu(unit, build)


def tell_plan(unit: Path) -> None:
    """Print what a planned motion determines; nothing is written."""
    from triaxcal.design.imu import plan_unit  # noqa: PLC0415
    from triaxcal.report.dynamic import plan_summary  # noqa: PLC0415

    with _bar() as progress:
        done = plan_unit(unit, progress)
    say(plan_summary(done))


def calibrate_imu(unit: Path, build: Path) -> None:
    """Do the work of `triaxcal dynamic`, and of `triaxcal calib` for a unit with [dynamic]."""
    from triaxcal.base.publish import publish  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files, dynamic_summary  # noqa: PLC0415
    from triaxcal.report.imuc import C_FILES  # noqa: PLC0415

    made = delivered_imu(unit)
    files = dynamic_files(made)
    target = build / made.done.unit.name
    publish(files, target, C_FILES)
    say(dynamic_summary(made, files, str(target)))


def delivered_imu(unit: Path) -> ImuDelivery:
    """Calibrate the IMU and make its C, with a bar of progress."""
    from triaxcal.delivery.imu import deliver_imu  # noqa: PLC0415

    with _bar() as progress:
        return deliver_imu(unit, progress)


@contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """Progress on the screen, by the name of a step and the part of it that is done."""
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

        yield progress
