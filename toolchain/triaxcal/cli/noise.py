"""`triaxcal noise`: noise of a recording at rest."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import PICTURE, command, example, show


@command(
    epilog=example(
        "triaxcal noise rest.csv --layout logger.toml",
        "triaxcal noise rest.csv --layout logger.toml --tau 100 --picture allan.svg",
    )
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--layout",
    required=True,
    type=click.Path(path_type=Path),
    help="TOML file with the [recording] of FILE, or the unit.toml of an IMU.",
)
@click.option("--tau", type=float, help="Longest averaging time that is wanted, s.")
@PICTURE
def noise(file: Path, layout: Path, tau: float | None, picture: Path | None) -> None:
    """Noise of a recording at rest.

    The five coefficients of IEEE Std 952 with 95 % intervals, and the lowest Allan deviation, of
    each output. The picture is the Allan deviation. With the unit.toml of an IMU, of both triads,
    and its [noise] to paste.
    """
    import triaxcal  # noqa: PLC0415

    show(triaxcal.study_noise(file, layout, longest_tau_s=tau), picture)
