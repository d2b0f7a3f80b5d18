"""triaxcal update: a delivered calibration brought up to date by poses from the field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from triaxcal.cli.options import command, example, field_command, say


def _drift(
    flag: str, argument: str, words: str
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    size = click.FloatRange(min=0.0, min_open=True)
    return click.option(flag, argument, type=size, metavar="FLOAT", help=f"Drift of {words} (sd).")


@command(
    epilog=example(
        "triaxcal update MPU-1 --with field.csv",
        "triaxcal update MPU-1 --with field.csv --bias-drift 5 --into out",
        "triaxcal update generated/calibration.json --with field.csv --into out",
    )
)
@field_command("--with", "Recording of one still pose or more.")
@click.option(
    "--into", type=click.Path(path_type=Path), help="Write here and leave the delivered unit alone."
)
@_drift("--bias-drift", "bias_drift_mg", "a bias since then, mg")
@_drift("--scale-drift", "scale_drift_ppm", "a scale since then, ppm")
@_drift("--axes-drift", "axes_drift_micro_rad", "an angle between axes, micro-rad")
def update(unit: Path, build: Path, recorded: Path, **stated: Any) -> None:
    """Update a delivered calibration with a few poses.

    UNIT is a unit, whose constants are those in build/UNIT/calibration.json, or a delivered folder,
    or a calibration.json itself. The constants, their uncertainty and a drift since then are the
    prior. Poses in which |a| = g give new constants and a new C. Poses that contradict the
    calibration, or tell less than it, are refused. The files before are kept beside the new ones.

    By default the drift follows from the limits of the unit: two standard deviations of a bias are
    its limit over the range.
    """
    import triaxcal  # noqa: PLC0415

    say(triaxcal.update(unit, recorded, build, **stated).summary)
