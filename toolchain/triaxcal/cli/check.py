"""triaxcal check: a delivered calibration against a recording that was not used for it."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from triaxcal.cli.options import (
    DELIVERED,
    UnitFolder,
    by_option,
    command,
    example,
    field_options,
    say,
)


@command(
    epilog=example(
        "triaxcal check MPU-1 --on field.csv",
        "triaxcal check MPU-1 --on field.csv --gravity 9.8321",
        "triaxcal check AT-0042 --on checks.csv --layout logger.toml",
    )
)
@click.argument("unit", type=UnitFolder())
@DELIVERED
@click.option(
    "--on",
    "recorded",
    required=True,
    type=click.Path(path_type=Path),
    help="Recording that was not used for the calibration.",
)
@field_options
def check(
    unit: Path, build: Path, recorded: Path, layout: Path | None, gravity: float | None
) -> None:
    """Check a delivered calibration with a new recording.

    The constants are those in build/UNIT/calibration.json. At each still pose of the recording |a|
    - g is compared with the uncertainty that is expected there and with the limits of the unit. The
    exit code is 1 when the check fails.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.api.delivery import delivered_file  # noqa: PLC0415

    done = triaxcal.load(delivered_file(unit, build))
    try:
        found = done.check(recorded, layout=layout, gravity_m_per_s2=gravity)
    except triaxcal.RefusedError as refusal:
        raise by_option(refusal) from refusal
    say(found.summary)
    sys.exit(not found.result.passed)
