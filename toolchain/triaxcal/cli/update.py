"""triaxcal update: a delivered calibration brought up to date by poses from the field."""

from __future__ import annotations

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
        "triaxcal update MPU-1 --with field.csv",
        "triaxcal update MPU-1 --with field.csv --bias-drift 5 --into out",
    )
)
@click.argument("unit", type=UnitFolder())
@DELIVERED
@click.option(
    "--with",
    "recorded",
    required=True,
    type=click.Path(path_type=Path),
    help="Recording of one still pose or more.",
)
@click.option(
    "--into", type=click.Path(path_type=Path), help="Write here and leave the delivered unit alone."
)
@click.option("--bias-drift", type=float, help="Drift of a bias since then, mg (sd).")
@click.option("--scale-drift", type=float, help="Drift of a scale since then, ppm (sd).")
@click.option("--axes-drift", type=float, help="Drift of an angle between axes, micro-rad (sd).")
@field_options
def update(  # noqa: PLR0917
    unit: Path,
    build: Path,
    recorded: Path,
    into: Path | None,
    bias_drift: float | None,
    scale_drift: float | None,
    axes_drift: float | None,
    layout: Path | None,
    gravity: float | None,
) -> None:
    """Update a delivered calibration with a few poses.

    The constants in build/UNIT/calibration.json, their uncertainty and a drift since then are the
    prior. Poses in which |a| = g give new constants and a new C. Poses that contradict the
    calibration are refused. The files before are kept beside the new ones.

    By default the drift follows from the limits of the unit: two standard deviations of a bias are
    its limit over the range.
    """
    import triaxcal  # noqa: PLC0415

    try:
        done = triaxcal.update(
            unit,
            recorded,
            build,
            into=into,
            layout=layout,
            gravity_m_per_s2=gravity,
            bias_drift_mg=bias_drift,
            scale_drift_ppm=scale_drift,
            axes_drift_micro_rad=axes_drift,
        )
    except triaxcal.RefusedError as refusal:
        raise by_option(refusal) from refusal
    say(done.summary)
