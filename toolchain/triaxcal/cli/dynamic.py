"""`triaxcal dynamic`: a whole IMU from a recording by hand or on a table."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import command, example, show, unit_and_build
from triaxcal.cli.progress import bar, calibrate


@command(epilog=example("triaxcal dynamic IMU-SIM", "triaxcal dynamic IMU-SIM --plan"))
@unit_and_build
@click.option(
    "--plan",
    is_flag=True,
    help="Report what a planned motion determines, and how much of it reaches [limits]; without a "
    "recording.",
)
def dynamic(unit: Path, build: Path, plan: bool) -> None:
    """Calibrate a whole IMU that is turned by hand or on a table.

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
    import triaxcal  # noqa: PLC0415

    with bar() as progress:
        done = triaxcal.plan_motion(unit, progress)
    show(done)
