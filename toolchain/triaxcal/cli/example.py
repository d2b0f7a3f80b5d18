"""`triaxcal example`: example units to copy and try."""

from __future__ import annotations

from pathlib import Path

import click

import triaxcal
from triaxcal.base.extras import quoted
from triaxcal.cli.options import command
from triaxcal.cli.options import example as examples_of_use


@command(epilog=examples_of_use("triaxcal example", "triaxcal example AT-SIM"))
@click.argument("name", required=False)
@click.option(
    "--into",
    type=click.Path(path_type=Path),
    default=Path(),
    help="Folder that receives the unit's folder; default: the current one.",
)
def example(name: str | None, into: Path) -> None:
    """Copy an example unit, to try the other commands on.

    Without NAME the examples are listed. Nothing is overwritten.
    """
    found = triaxcal.examples()
    if name is None:
        width = max(len(one.name) for one in found)
        for one in found:
            click.echo(f"{one.name:{width}}  {one.description}")
        click.echo(f"\nCopy one: triaxcal example {found[0].name}")
        return
    folder = triaxcal.copy_example(name, into)
    click.echo(f"{folder} written. Next:")
    for line in next(one.commands for one in found if one.name == name):
        click.echo("  " + line.format(quoted(str(folder))))
