"""Packages that print what they find wrong: silent in a thread that reads, and in no other."""

from __future__ import annotations

import builtins
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

_THREAD = threading.local()


@contextmanager
def quiet(module: ModuleType) -> Iterator[None]:
    """Nothing that `module` prints in this thread meanwhile is shown."""
    vars(module)["print"] = _print  # hides the builtin there, for good
    _THREAD.quiet = True
    try:
        yield
    finally:
        _THREAD.quiet = False


def _print(*values: Any, **options: Any) -> None:
    if not getattr(_THREAD, "quiet", False):
        builtins.print(*values, **options)
