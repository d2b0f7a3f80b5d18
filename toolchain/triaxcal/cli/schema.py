"""`triaxcal schema`: the JSON Schema of a TOML file."""

from __future__ import annotations

import json

import click

import triaxcal
from triaxcal.cli.options import command, example
from triaxcal.keytable.catalogue import FILES


@command(epilog=example("triaxcal schema tilter"))
@click.argument("kind", type=click.Choice(tuple(FILES)))
def schema(kind: str) -> None:
    """Print the JSON Schema of a kind of TOML file.

    Editors and other programs complete and check a file with it.
    """
    click.echo(json.dumps(triaxcal.key_schema(kind), indent=1))
