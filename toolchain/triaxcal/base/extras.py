"""Optional packages: which are missing, and the command that installs them."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from triaxcal.base.errors import RefusedError


def install_command(extra: str) -> str:
    """Command that a shell in the current folder runs to install an extra of triaxcal."""
    python = sys.executable
    if shutil.which("python") == python:
        python = "python"
    elif Path(python).is_relative_to(Path.cwd()):
        python = os.path.relpath(python)
        python = python if os.sep in python else f".{os.sep}{python}"
    return f"{shlex.quote(python)} -m pip install 'triaxcal[{extra}]'"


def refuse_missing_packages(place: str, packages: Iterable[str], extra: str) -> None:
    """Refuse where packages of an extra are not installed.

    Parameters
    ----------
    place : str
        What needs them, for the message.
    packages : iterable of str
        Names as they are imported.

    Raises
    ------
    RefusedError
        Naming them, and the command that installs them.
    """
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise RefusedError(
            place,
            "missing packages: " + ", ".join(missing),
            remedy="install them: " + install_command(extra),
        )
