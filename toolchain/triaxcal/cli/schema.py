"""`triaxcal schema`: the JSON Schema of a TOML file."""

from __future__ import annotations

import json

import click

from triaxcal.cli.options import example
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.schema import json_schema


@click.command(epilog=example("triaxcal schema tilter > unit.schema.json"))
@click.argument("kind", type=click.Choice(tuple(FILES)))
def schema(kind: str) -> None:
    """Print the JSON Schema of a KIND of TOML file, for editors and other programs."""
    click.echo(json.dumps(json_schema(FILES[kind]()), indent=1))
