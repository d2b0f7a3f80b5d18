"""The C compiler: found, started in the background, its complaints in one line."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.shipped import shipped

WARNINGS = (
    "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion",
    "-Wsign-conversion",
)  # fmt: skip
"""All of the C is clean under these; a warning is an error."""
FLAGS = (WARNINGS[0], "-O2", *WARNINGS[1:])


def find_compiler() -> str:
    """Path of gcc.

    Raises
    ------
    RefusedError
        When it is not installed.
    """
    found = shutil.which("gcc")
    if found is None:
        raise RefusedError(
            "gcc", "not found", remedy="install it: sudo apt-get install gcc libc6-dev"
        )
    return found


@dataclass(frozen=True)
class Compilation:
    """A compilation under way."""

    process: subprocess.Popen[str]
    library: Path

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
        if self.process.returncode != 0:
            lines = [line for line in complaints.splitlines() if "error" in line.lower()]
            raise RefusedError(
                "gcc",
                (lines or complaints.splitlines() or ["failed without a message"])[0],
                remedy="check the compiler with a small program, and the space in the temp folder",
            )
        try:
            return ctypes.CDLL(str(self.library))
        except OSError as error:
            raise RefusedError(
                "gcc",
                f"printed nothing and made no library that loads ({error})",
                remedy="check that the gcc on PATH is a C compiler for this machine",
            ) from error

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
    """Start gcc on C sources, to a shared library."""
    command = [
        find_compiler(),
        *flags,
        "-shared",
        "-fPIC",
        *(f"-I{folder}" for folder in include),
        "-o",
        str(library),
        *map(str, sources),
    ]
    try:
        process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"TMPDIR": str(library.parent)},
        )
    except OSError as error:
        remedy = "install gcc: sudo apt-get install gcc libc6-dev"
        raise refused_by_system(command[0], "run", error, remedy=remedy) from error
    return Compilation(process, library)


def start_reference(folder: Path) -> Compilation:
    """Start compiling the handwritten reference; it does not depend on the unit.

    By -O1, which runs as fast and takes half as long to compile; and what an optimisation breaks
    need not be broken in both.
    """
    source = shipped("firmware_ref")
    sources = [source / "triax_ref.c", source / "triax_ref_image.c"]
    return compile_library(sources, folder / "triax_ref.so", flags=(*WARNINGS, "-O1"))


@contextmanager
def reference_under_way() -> Iterator[Compilation]:
    """Compile the reference in the background; it is stopped when the caller fails."""
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as folder:
        compilation = start_reference(Path(folder))
        try:
            yield compilation
        finally:
            compilation.cancel()
