"""Any program: a command line sets, another prints what is."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.keys import setting
from triaxcal.base.kinds import TEXT, Kind, listed
from triaxcal.rig.hands.instrument import Driver, Order, filled, numbers_in

_WORDS: Kind[tuple[str, ...]] = listed(TEXT, range(1, 65), "a list of 1 to 64 texts")


@dataclass(frozen=True)
class _Settings:
    """Keys of the driver.

    Attributes
    ----------
    command
        Driver command: program and arguments that give the order. No shell reads them.
    command_read
        Driver command: program and arguments that print what is.
    """

    command: tuple[str, ...] = setting(_WORDS, (), example='["chamberctl", "set", "{degc:.2f}"]')
    command_read: tuple[str, ...] = setting(_WORDS, (), example='["chamberctl", "read"]')


class _Commands:
    """Runs the programs."""

    def __init__(self, settings: _Settings, timeout_s: float) -> None:
        self._settings = settings
        self._timeout_s = timeout_s

    def write(self, order: Order) -> None:
        """Run the program that sets."""
        self._run([filled(word, order) for word in self._settings.command])

    def read(self) -> tuple[float, ...]:
        """Numbers that the other program prints."""
        words = list(self._settings.command_read)
        return numbers_in(self._run(words), words[0])

    def close(self) -> None:
        """Nothing is open."""

    def _run(self, words: Sequence[str]) -> str:
        try:
            done = subprocess.run(
                words,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                text=True,
                errors="replace",
                check=False,
                timeout=self._timeout_s,
                start_new_session=True,  # Ctrl-C is for the bench, which then gives its last order
            )
        except subprocess.TimeoutExpired as error:
            raise RefusedError(words[0], f"did not end within {self._timeout_s:g} s") from error
        except OSError as error:
            raise refused_by_system(words[0], "started", error) from error
        if done.returncode:
            said = (done.stderr.strip().splitlines() or ["without a message"])[-1]
            raise RefusedError(words[0], f"ended with exit code {done.returncode}: {said}")
        return done.stdout


ENTRY = Driver(
    "command",
    "command line",
    "Any program.",
    _Settings,
    _Commands,
    needs=("command",),
    texts=("command",),
    reads="command_read",
    rank=20,
)
