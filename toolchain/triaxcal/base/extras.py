"""Optional packages: which are missing, and the command that installs them."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from triaxcal.base.errors import RefusedError

EXTRAS = {
    "cc": "a C compiler, where the system has none",
    "rig": "rig: the bench over CAN",
    "instruments": "rig: chambers, positioners, voltmeters, serial boards",
    "device": "device: a unit over XCP on CAN",
    "export": "rig export: MF4 and Parquet",
    "parquet": "recordings in Parquet",
    "hdf5": "recordings in HDF5, MAT-files of version 7.3",
    "excel": "recordings in Excel files",
    "ulog": "recordings of PX4",
    "ros": "recordings of ROS, MCAP",
    "ardupilot": "recordings of ArduPilot",
    "mf4": "recordings in MF4",
    "series": "batch: many units on a Dask cluster",
    "production": "image: Intel HEX and SREC; a2l: addresses of a program",
    "sign": "certificate: against the schema, signed, verified",
    "proof": "verify: the compiled code, for every input",
    "noise": "noise, report: the Allan deviation",
    "plot": "Calibration.plot in Python",
}
"""What each extra of pyproject.toml is for, less those for developers."""


def install_command(extra: str) -> str:
    """Command that a shell in the current folder runs to install an extra of triaxcal."""
    return pip_command(f"triaxcal[{extra}]")


def pip_command(requirement: str) -> str:
    """Command that a shell in the current folder runs to install a package."""
    python = sys.executable
    if shutil.which("python") == python:
        python = "python"
    elif Path(python).is_relative_to(Path.cwd()):
        python = os.path.relpath(python)
        python = python if os.sep in python else f".{os.sep}{python}"
    return f"{quoted(python)} -m pip install {quoted(requirement)}"


def quoted(word: str) -> str:
    """A word as the shell of this system takes it for one."""
    return subprocess.list2cmdline([word]) if os.name == "nt" else shlex.quote(word)


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
