"""triaxcal drift: one orientation over temperature, heating against cooling."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, UnitFolder, example, say


@click.command(epilog=example("triaxcal drift MPU-1 --picture drift.svg"))
@click.argument("unit", type=UnitFolder())
@PICTURE
def drift(unit: Path, picture: Path | None) -> None:
    """Compare heating with cooling in one orientation.

    The recording of UNIT is a thermal cycle at rest. Its half-cycles show the hysteresis, and
    whether a term in dT/dt predicts held-out half-cycles better.
    """
    from triaxcal.cli.recorded import recorded, write_picture  # noqa: PLC0415
    from triaxcal.fitting.core.drift import study  # noqa: PLC0415
    from triaxcal.report.studies import drift_picture, drift_text  # noqa: PLC0415

    layout, samples = recorded(unit)
    found = study(samples)
    if picture is not None:
        write_picture(picture, drift_picture(samples, found, layout))
    say(drift_text(found, layout))
