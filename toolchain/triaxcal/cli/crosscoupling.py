"""triaxcal crosscoupling: an orthogonal pair of accelerometers on a dividing head, P3."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, command, example, show


@command(epilog=example("triaxcal crosscoupling pair.csv --picture pair.svg"))
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--gravity",
    type=click.FloatRange(9.7, 9.9),
    default=9.80665,
    show_default=True,
    help="Local gravity, m/s^2.",
)
@PICTURE
def crosscoupling(file: Path, gravity: float, picture: Path | None) -> None:
    """Fit the cross-coupling of a pair of accelerometers.

    FILE is a CSV with columns theta_deg, a_g, b_g and one row for each position of the dividing
    head.
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.cross_coupling(file, gravity), picture)
