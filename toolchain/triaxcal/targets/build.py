"""Building a program for a core and running it under its emulator."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import WARNINGS
from triaxcal.targets.cores.core import Core
from triaxcal.unit.arithmetic import PORTABLE

T = TypeVar("T")
RUN_SECONDS = 600.0
"""A program that runs longer hangs; the slowest of the matrix takes about 20 s."""


class TargetError(Exception):
    """A build or a run failed; the text is its first complaint."""


@dataclass(frozen=True)
class Toolset:
    """A compiler with its flags for one core.

    Attributes
    ----------
    compiler : str
        "gcc" or "clang".
    optimisation : str
        As "-O2".
    arithmetic : str
        That of the generated routine: it says which of its files are compiled.
    defines : tuple of str
        More macros, as "-DNAME=value".
    """

    core: Core
    compiler: str
    optimisation: str
    arithmetic: str = PORTABLE
    defines: tuple[str, ...] = ()

    def command(self) -> list[str]:
        """Compile command without inputs and outputs."""
        core = self.core
        driver = (
            [core.gcc] if self.compiler == "gcc" else ["clang", f"--target={core.clang_triple}"]
        )
        hosted = ["-DTARGET_HOSTED"] if core.hosted else ["-ffreestanding"]
        return [
            *driver, *core.flags, *WARNINGS, *hosted, self.optimisation,
            "-ffunction-sections", "-fdata-sections",
            "-DTRIAX_REF_MAX_SEGMENTS=8", f"-DCASE_VECTORS={core.vectors}u", *self.defines,
        ]  # fmt: skip


def build(
    toolset: Toolset, sources: Sequence[Path], include: Sequence[Path], program: Path
) -> None:
    """Compile and link `sources` with the start-up code into `program`.

    Raises
    ------
    TargetError
        With the compiler's first complaint.
    """
    objects = compiled(toolset, [*sources, *_support(toolset.core)], include, program.parent)
    run([*link_command(toolset.core), *objects, "-lgcc", "-o", str(program)])


def compiled(
    toolset: Toolset, sources: Sequence[Path], include: Sequence[Path], folder: Path
) -> list[str]:
    """Objects of `sources`, in a folder that is made where there is none.

    Raises
    ------
    TargetError
        With the compiler's first complaint.
    """
    folder.mkdir(parents=True, exist_ok=True)
    includes = [f"-I{path}" for path in (*include, shipped("firmware_ref") / "target")]
    objects = []
    for source in sources:
        made = str(folder / f"{source.stem}.o")
        run([*toolset.command(), *includes, "-c", str(source), "-o", made])
        objects.append(made)
    return objects


def _support(core: Core) -> list[Path]:
    target = shipped("firmware_ref") / "target"
    if not core.memory:
        return [target / "target_io.c"]
    start = "riscv_start.S" if "riscv" in core.gcc else "cortexm_start.c"
    return [target / start, target / "target_io.c"]


def link_command(core: Core) -> list[str]:
    """Link command without inputs and outputs."""
    if not core.memory:
        return [core.gcc, *core.flags, "-static"]
    script = "riscv.ld" if "riscv" in core.gcc else "cortexm.ld"
    return [
        core.gcc, *core.flags, "-nostdlib", "-nostartfiles", "-Wl,--gc-sections",
        *(f"-Wl,--defsym={name}={value}" for name, value in core.memory.items()),
        f"-Wl,-T,{shipped('firmware_ref') / 'target' / script}", "-Wl,--no-warn-rwx-segments",
    ]  # fmt: skip


def in_parallel(jobs: Sequence[Callable[[], T]], done: Callable[[T], None]) -> list[T]:
    """Results of jobs, which run on all cores, in their order; `done` gets each as it ends."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        futures = [pool.submit(job) for job in jobs]
        for future in as_completed(futures):
            done(future.result())
    return [future.result() for future in futures]


def emulate(core: Core, program: Path, extra: Sequence[str] = ()) -> str:
    """Run `program` and return what it printed.

    Raises
    ------
    TargetError
        When it ends with an error or does not end.
    """
    emulator, *options = core.emulator
    done = _finished([emulator, *extra, *options, str(program)])
    return core.printed(done.stdout, done.stderr)


def run(command: Sequence[str]) -> str:
    """Run a tool and return its standard output.

    Raises
    ------
    TargetError
        With its first complaint.
    """
    return _finished(command).stdout


def _finished(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=RUN_SECONDS,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as late:
        raise TargetError(f"{command[0]} did not end within {RUN_SECONDS:g} s") from late
    if done.returncode != 0:
        lines = (done.stderr + done.stdout).splitlines()
        errors = [line for line in lines if "error" in line.lower()] or lines
        complaint = errors[0] if errors else f"exit code {done.returncode}"
        raise TargetError(f"{Path(command[0]).name}: {complaint}")
    return done
