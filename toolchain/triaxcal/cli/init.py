"""`triaxcal init`: a first, commented file of a unit, a session, or a simulation."""

from __future__ import annotations

from pathlib import Path

import click

import triaxcal
from triaxcal.cli.options import command, example
from triaxcal.keytable.catalogue import FILES


@command(epilog=example("triaxcal init units/SN-0042", "triaxcal init units/IMU-7 --kind imu"))
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--kind",
    type=click.Choice(tuple(FILES)),
    default="tilter",
    show_default=True,
    metavar="KIND",
    help="What the file describes: " + ", ".join(FILES) + ".",
)
def init(folder: Path, kind: str) -> None:
    """Write a first, commented file of a unit.

    It goes into FOLDER, and beside it a JSON Schema with which editors complete and check it.
    Required keys stand there with an example. The others are commented out, with their defaults.
    No file is overwritten.
    """
    path, schema = triaxcal.write_first_file(folder, kind)
    click.echo(f"{path} written; replace its examples. {schema.name} is for your editor.")
