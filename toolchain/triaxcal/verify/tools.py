"""External tools, started with a time limit."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

TIME_LIMIT_S = 900
"""Beyond this a tool is hanging: the slowest takes seconds."""


class BrokenToolError(Exception):
    """A tool did not finish its work; the text says how."""


@dataclass(frozen=True)
class Answer:
    """Exit code and output, standard output first."""

    code: int
    text: str


def run(
    command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> Answer:
    """Run a tool in a folder, in English.

    Raises
    ------
    BrokenToolError
        When it does not end within `TIME_LIMIT_S` or is killed by a signal.
    """
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            # Frama-C believes PWD rather than the system.
            env={**os.environ, "LC_ALL": "C.UTF-8", "PWD": str(folder), **(environment or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIME_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise BrokenToolError(
            f"{Path(command[0]).name} did not end within {TIME_LIMIT_S} s"
        ) from error
    if done.returncode < 0:
        name = Path(command[0]).name
        raise BrokenToolError(f"{name} was killed by signal {-done.returncode}")
    return Answer(done.returncode, done.stdout + done.stderr)
