"""The command that installs an optional part into the Python that runs."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path


def install_command(extra: str) -> str:
    """Command that a shell in the current folder runs to install an extra of triaxcal."""
    python = sys.executable
    if shutil.which("python") == python:
        python = "python"
    elif Path(python).is_relative_to(Path.cwd()):
        python = os.path.relpath(python)
        python = python if os.sep in python else f".{os.sep}{python}"
    return f"{shlex.quote(python)} -m pip install 'triaxcal[{extra}]'"
