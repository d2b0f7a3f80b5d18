"""triaxcal check: a delivered calibration against a recording that was not used for it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from triaxcal.cli.options import command, example, field_command, say


@command(
    epilog=example(
        "triaxcal check MPU-1 --on field.csv",
        "triaxcal check MPU-1 --on field.csv --gravity 9.8321",
        "triaxcal check AT-0042 --on checks.csv --layout logger.toml",
        "triaxcal check generated/calibration.json --on field.csv",
    )
)
@field_command("--on", "Recording that was not used for the calibration.")
def check(unit: Path, build: Path, recorded: Path, **stated: Any) -> None:
    """Check a delivered calibration with a new recording.

    UNIT is a unit, whose constants are those in build/UNIT/calibration.json, or a delivered folder,
    or a calibration.json itself. At each still pose of the recording |a| - g is compared with the
    uncertainty that is expected there and with the limits of the unit. The exit code is 1 when the
    check fails.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.api.delivery import delivered_file  # noqa: PLC0415

    found = triaxcal.load(delivered_file(unit, build)).check(recorded, **stated)
    say(found.summary)
    sys.exit(not found.result.passed)
