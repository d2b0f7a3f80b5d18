"""Which C compiler: the one that CC names, else gcc, clang, or the one of the package ziglang."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.base.tools import TOOLS, version_of

ZIGLANG = "ziglang"
_OTHER_OPTIONS = {"cl", "clang-cl", "icl", "armcc", "iccarm"}
"""Compilers of other options than gcc's."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler of gcc's options: its name for readers, and the command that starts it."""

    name: str
    command: tuple[str, ...]

    def called(self, version: str) -> str:
        """The compiler by its name and the version that it compiles in."""
        return f"{self.name} {version}" if version[:1].isdigit() else f"{self.name}, {version}"

    def version(self) -> str:
        """First line of what it says about its version."""
        return version_of((*self.command, "--version"))


def find_compiler() -> Compiler:
    """The compiler for this machine.

    Raises
    ------
    RefusedError
        When none is installed, or what the variable CC names cannot be taken.
    """
    chosen = os.environ.get("CC", "").strip()
    if chosen:
        return _named(chosen)
    for find in COMPILERS.values():
        found = find()
        if found is not None:
            return found
    raise RefusedError(
        "C compiler",
        f"not found: no {', no '.join(COMPILERS)}",
        remedy=f"install one: {install_advice()}",
    )


def install_advice() -> str:
    """Commands, each of which installs a compiler."""
    return f"{TOOLS['gcc'].install_command()}, or {install_command('cc')}"


def _named(chosen: str) -> Compiler:
    """What CC says: a program, perhaps with options."""
    try:
        words = [chosen] if shutil.which(chosen) else shlex.split(chosen, posix=os.name == "posix")
    except ValueError as error:
        raise RefusedError("CC", f"found {chosen!r}: {error}", expected="a command") from error
    program, *options = (word.strip('"') for word in words)
    if Path(program).stem.lower() in _OTHER_OPTIONS:
        raise RefusedError(
            "CC",
            f"found {chosen!r}",
            expected="a compiler with the options of gcc, as clang or python -m ziglang cc",
            remedy="unset CC, or name such a compiler",
        )
    path = shutil.which(program)
    if path is None:
        raise RefusedError(
            "CC",
            f"found {chosen!r}, and there is no program {program!r}",
            remedy="unset CC, or name a compiler that is installed",
        )
    return Compiler(" ".join((Path(program).name, *options)), (path, *options))


def _on_path(name: str) -> Callable[[], Compiler | None]:
    def find() -> Compiler | None:
        path = shutil.which(name)
        return Compiler(name, (path,)) if path else None

    return find


def _clang() -> Compiler | None:
    """Windows' clang usually links for Visual C++, which exports no function unless it is told."""
    found = _on_path("clang")()
    if found and sys.platform == "win32":
        machine = version_of((*found.command, "-dumpmachine"))
        return None if machine.endswith("msvc") else found
    return found


def _ziglang() -> Compiler | None:
    spec = importlib.util.find_spec(ZIGLANG)
    if spec is None or spec.origin is None:  # a folder of that name is no package
        return None
    # -P: what lies in the current folder is not imported.
    return Compiler(ZIGLANG, (sys.executable, "-P", "-m", ZIGLANG, "cc"))


COMPILERS: dict[str, Callable[[], Compiler | None]] = {
    "gcc": _on_path("gcc"),
    "clang": _clang,
    ZIGLANG: _ziglang,
}
"""What is looked for where CC names none, in this order."""
