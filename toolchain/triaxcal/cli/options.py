"""What the commands that calibrate one unit ask for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

_UNIT = click.argument("unit", type=click.Path(path_type=Path))
_BUILD = click.option(
    "--build",
    type=click.Path(path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder that receives a folder of the unit's name.",
)


def unit_and_build(command: Callable[..., Any]) -> Callable[..., Any]:
    """UNIT and --build."""
    return _UNIT(_BUILD(command))
