"""`triaxcal doctor`: what is installed, what is missing, and how to install it."""

from __future__ import annotations

import sys

import click

from triaxcal.cli.options import command, example


@command(epilog=example("triaxcal doctor", "triaxcal doctor --json"))
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def doctor(as_json: bool) -> None:
    """List what is installed, and how to install what is missing.

    The C compiler is tried with a small library. The exit code is 1 when `calib` could not work.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.base.jsontext import json_bytes  # noqa: PLC0415

    found = triaxcal.installation()
    text = json_bytes(found.document()).decode().rstrip() if as_json else found.summary
    click.echo(text)
    if not found.works:
        sys.exit(1)
