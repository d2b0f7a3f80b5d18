"""triaxcal drift: one orientation over temperature, heating against cooling."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("unit", type=click.Path(path_type=Path))
@click.option("--picture", type=click.Path(path_type=Path), help="Also draw it into this SVG.")
def drift(unit: Path, picture: Path | None) -> None:
    """Show what the outputs of UNIT do over a thermal cycle at rest in one orientation."""
    from triaxcal.cli.recorded import recorded, write_picture  # noqa: PLC0415
    from triaxcal.fitting.core.drift import study  # noqa: PLC0415
    from triaxcal.report.studies import drift_picture, drift_text  # noqa: PLC0415

    layout, samples = recorded(unit)
    found = study(samples)
    if picture is not None:
        write_picture(picture, drift_picture(samples, found, layout))
    click.echo(drift_text(found, layout))
