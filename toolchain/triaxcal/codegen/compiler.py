"""The C compiler: found, started in the background, its complaints in one line."""

from __future__ import annotations

import _ctypes
import ctypes
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.shipped import shipped
from triaxcal.base.tools import NO_CONSOLE
from triaxcal.codegen.compilers import Compiler, find_compiler, install_advice

WARNINGS = (
    "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion",
    "-Wsign-conversion",
)  # fmt: skip
"""All of the C is clean under these; a warning is an error."""
FLAGS = (WARNINGS[0], "-O2", *WARNINGS[1:])
_SUFFIXES = {"win32": ".dll", "cygwin": ".dll", "darwin": ".dylib"}
_loaded: list[tuple[Path, ctypes.CDLL]] = []
"""Libraries that Windows has to give back, by their file."""


def library_suffix(platform: str = sys.platform) -> str:
    """Ending of a shared library's name."""
    return _SUFFIXES.get(platform, ".so")


def library_flags(platform: str = sys.platform) -> tuple[str, ...]:
    """What makes a shared library; code for Windows is position independent without a flag."""
    return ("-shared",) if library_suffix(platform) == ".dll" else ("-shared", "-fPIC")


@dataclass(frozen=True)
class Compilation:
    """A compilation under way."""

    process: subprocess.Popen[str]
    library: Path
    compiler: Compiler

    def load(self) -> ctypes.CDLL:
        """Wait for it and load the library.

        Raises
        ------
        RefusedError
            When the compiler refused: its first complaint.
        """
        complaints, _ = self.process.communicate()
        if self.process.returncode == -signal.SIGINT:
            raise KeyboardInterrupt
        name = self.compiler.name
        if self.process.returncode != 0:
            lines = [line for line in complaints.splitlines() if "error" in line.lower()]
            raise RefusedError(
                name,
                (lines or complaints.splitlines() or ["failed without a message"])[0],
                remedy="check the compiler with a small program, and the space in the temp folder; "
                "CC names another compiler",
            )
        try:
            library = ctypes.CDLL(str(self.library))
        except OSError as error:
            raise RefusedError(
                name,
                f"printed nothing and made no library that loads ({error})",
                remedy=f"check that this {name} is a C compiler for this machine; CC names another",
            ) from error
        if hasattr(_ctypes, "FreeLibrary"):
            _loaded.append((self.library, library))
        return library

    def cancel(self) -> None:
        """Stop it, if it still runs."""
        if self.process.returncode is None:
            self.process.terminate()  # not kill: gcc removes its temporary files
            self.process.communicate()


def compile_library(
    sources: Sequence[Path],
    library: Path,
    include: Sequence[Path] = (),
    flags: Sequence[str] = FLAGS,
) -> Compilation:
    """Start the compiler on C sources, to a shared library; its name gets the system's ending."""
    library = library.with_suffix(library_suffix())
    return _start([*flags, *library_flags()], sources, library, include)


def compile_object(source: Path, target: Path, include: Sequence[Path] = ()) -> Compilation:
    """Start the compiler on one source, to an object that can be linked to such a library."""
    flags = [flag for flag in library_flags() if flag != "-shared"]
    return _start([*FLAGS, *flags, "-c"], [source], target, include)


def _start(
    flags: Sequence[str], sources: Sequence[Path], target: Path, include: Sequence[Path]
) -> Compilation:
    compiler = find_compiler()
    folders = [f"-I{folder}" for folder in include]
    command = [*compiler.command, *flags, *folders, "-o", str(target), *map(str, sources)]
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env=os.environ | _litter(target.parent),
            creationflags=NO_CONSOLE,
        )
    except OSError as error:
        raise refused_by_system(
            command[0], "run", error, remedy=f"install another: {install_advice()}"
        ) from error
    return Compilation(process, target, compiler)


def _litter(folder: Path) -> dict[str, str]:
    """Environment in which a compiler keeps what is temporary in a folder."""
    names = ("TMPDIR", "TMP", "TEMP", "ZIG_LOCAL_CACHE_DIR")
    return dict.fromkeys(names, str(folder))


def start_reference(folder: Path) -> Compilation:
    """Start compiling the handwritten reference; it does not depend on the unit.

    By -O1, which runs as fast and takes half as long to compile; and what an optimisation breaks
    need not be broken in both.
    """
    source = shipped("firmware_ref")
    sources = [source / "triax_ref.c", source / "triax_ref_image.c"]
    return compile_library(sources, folder / "triax_ref", flags=(*WARNINGS, "-O1"))


@contextmanager
def reference_under_way() -> Iterator[Compilation]:
    """Compile the reference in the background; it is stopped when the caller fails."""
    with library_folder() as folder:
        compilation = start_reference(folder)
        try:
            yield compilation
        finally:
            compilation.cancel()


@contextmanager
def library_folder() -> Iterator[Path]:
    """A temporary folder whose libraries are not used after it.

    Windows removes no file of a library that is loaded: they are given back first.
    """
    with tempfile.TemporaryDirectory(prefix="triaxcal-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        try:
            yield folder
        finally:
            for entry in [e for e in _loaded if e[0].is_relative_to(folder)]:
                _loaded.remove(entry)
                _ctypes.FreeLibrary(entry[1]._handle)  # type: ignore[attr-defined,unused-ignore]
