"""Keys of a terminal, one at a time and without Return, on every system."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import select
import sys
from collections.abc import Iterator
from typing import Any

_KEY_CODE = re.compile(rb"\x1b(\[[0-9;]*[A-Za-z~]|O.)?")
"""An arrow or function key; there are digits in it."""
_FUNCTION_KEYS = "\x00\xe0"
"""What Windows gives first of an arrow or function key."""


class Keys:
    """Keys that have been pressed; none where the input is no terminal."""

    def __init__(self, wanted: bool) -> None:
        self._on = wanted and sys.stdin.isatty()
        self._posix = importlib.util.find_spec("termios") is not None
        if not self._posix and importlib.util.find_spec("msvcrt") is None:
            self._on = False

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Give keys as they are pressed; the terminal is as before afterwards."""
        if not (self._on and self._posix):
            yield
            return
        import termios  # noqa: PLC0415  not on Windows
        import tty  # noqa: PLC0415

        file = sys.stdin.fileno()
        before = termios.tcgetattr(file)
        tty.setcbreak(file)
        try:
            yield
        finally:
            termios.tcsetattr(file, termios.TCSADRAIN, before)

    def pressed(self) -> str:
        """Keys since last asked, without waiting."""
        if not self._on:
            return ""
        return self._of_terminal() if self._posix else _of_console()

    def _of_terminal(self) -> str:
        found = b""
        while self._on and select.select([sys.stdin], [], [], 0)[0]:
            typed = os.read(sys.stdin.fileno(), 64)
            self._on = bool(typed)
            found += typed
        return _KEY_CODE.sub(b"", found).decode("ascii", "ignore")


def _of_console() -> str:
    import msvcrt  # noqa: PLC0415  Windows alone

    console: Any = msvcrt
    found = ""
    while console.kbhit():
        key = console.getwch()
        if key in _FUNCTION_KEYS:
            console.getwch()
        else:
            found += key
    return found
