"""triaxcal crosscoupling: an orthogonal pair of accelerometers on a dividing head, P3."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, example, say


@click.command(epilog=example("triaxcal crosscoupling pair.csv --picture pair.svg"))
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
    from triaxcal.cli.recorded import write_picture  # noqa: PLC0415
    from triaxcal.fitting.pair.cross_coupling import fit_pair, recursive_pair  # noqa: PLC0415
    from triaxcal.readings.pair import read_pair  # noqa: PLC0415
    from triaxcal.report.studies import pair_picture, pair_text  # noqa: PLC0415

    theta, a, b = read_pair(file)
    fit = fit_pair(str(file), theta, a, b, gravity / 9.80665)
    recursion = recursive_pair(theta, a, b, gravity / 9.80665)
    if picture is not None:
        write_picture(picture, pair_picture(recursion))
    say(pair_text(fit, recursion))
