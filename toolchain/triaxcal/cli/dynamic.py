"""`triaxcal dynamic`: a whole IMU from a recording on a turntable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from triaxcal.cli.options import example, say, unit_and_build
from triaxcal.cli.progress import bar, calibrate

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
        import triaxcal  # noqa: PLC0415

        triaxcal.read_imu(unit)  # refuses a unit that is none
        calibrate(unit, build)


def tell_plan(unit: Path) -> None:
    """Print what a planned motion determines; nothing is written."""
    from triaxcal.design.imu import plan_unit  # noqa: PLC0415
    from triaxcal.report.dynamic import plan_summary  # noqa: PLC0415

    with bar() as progress:
        done = plan_unit(unit, progress)
    say(plan_summary(done))


def delivered_imu(unit: Path) -> ImuDelivery:
    """Calibrate the IMU and make its C, with a bar of progress."""
    from triaxcal.delivery.imu import deliver_imu  # noqa: PLC0415

    with bar() as progress:
        return deliver_imu(unit, progress)
