"""External tools, started with a time limit."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Timer

from triaxcal.base.tools import MissingToolError

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
    MissingToolError
    BrokenToolError
        When it does not end within `TIME_LIMIT_S` or is killed by a signal.
    """
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=_environment(folder, environment),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIME_LIMIT_S,
            check=False,
        )
    except FileNotFoundError as error:
        raise MissingToolError(f"{Path(command[0]).name} not found") from error
    except subprocess.TimeoutExpired as error:
        raise BrokenToolError(
            f"{Path(command[0]).name} did not end within {TIME_LIMIT_S} s"
        ) from error
    if done.returncode < 0:
        name = Path(command[0]).name
        raise BrokenToolError(f"{name} was killed by signal {-done.returncode}")
    return Answer(done.returncode, done.stdout + done.stderr)


def run_until(
    stop: Callable[[str], bool],
    command: Sequence[str],
    folder: Path,
    environment: Mapping[str, str] | None = None,
) -> Answer | None:
    """As `run`, but ended with all that it started at the first line for which `stop` holds.

    None where there was such a line.

    Raises
    ------
    BrokenToolError
        When it does not end within `TIME_LIMIT_S` or is killed by a signal.
    """
    started = subprocess.Popen(
        command,
        cwd=folder,
        env=_environment(folder, environment),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    limit = Timer(TIME_LIMIT_S, _end, [started])
    limit.start()
    lines = []
    try:
        assert started.stdout is not None
        for line in started.stdout:
            lines.append(line)
            if stop(line):
                return None
        code = started.wait()
    finally:
        limit.cancel()
        _end(started)
        started.communicate()
    if code < 0:
        raise BrokenToolError(f"{Path(command[0]).name} was killed by signal {-code}")
    return Answer(code, "".join(lines))


def _end(started: subprocess.Popen[str]) -> None:
    """End a process and those that it started."""
    with suppress(ProcessLookupError):
        os.killpg(started.pid, signal.SIGKILL)


def _environment(folder: Path, more: Mapping[str, str] | None) -> dict[str, str]:
    # Frama-C believes PWD rather than the system.
    return {**os.environ, "LC_ALL": "C.UTF-8", "PWD": str(folder), **(more or {})}
