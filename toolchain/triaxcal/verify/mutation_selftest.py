"""How many mutants of triax_comp.c the self-test of a unit finds, alone, as the device runs it."""

from __future__ import annotations

import subprocess
import zlib
from collections.abc import Sequence
from pathlib import Path

from triaxcal.verify.analyzers import GCC
from triaxcal.verify.mutation import FLAGS, SANITIZED, Bench
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import CONSTANTS, ROUTINE, SELFTEST, Workspace


class SelftestBench(Bench):
    """What calls the self-test, compiled once for each way of building; the routine changes."""

    def __init__(self, work: Workspace, shape: str) -> None:
        self.work = work
        self.shape = shape
        (work.folder / "bench").mkdir()
        source = work.render("bench/verify_selftest.c", "verify/mutant_selftest.c.j2", {})
        files = [source, *(work.folder / work.named(name) for name in (SELFTEST, CONSTANTS))]
        self.objects: dict[tuple[str, ...], list[str]] = {}
        for flags in (FLAGS, SANITIZED):
            self.objects[flags] = [self._object(file, flags) for file in files]

    def _object(self, source: Path, flags: tuple[str, ...]) -> str:
        made = source.with_name(f"{source.stem}_{zlib.crc32(repr(flags).encode()):08x}.o")
        command = [GCC.find(), *flags, f"-I{self.work.folder}", "-c", str(source), "-o", str(made)]
        answer = run(command, self.work.folder)
        if answer.code:
            raise BrokenToolError(answer.text)
        return str(made)

    def survives(
        self,
        folder: Path,
        flags: Sequence[str] = FLAGS,
        file: str = ROUTINE,
        image: Path | None = None,
    ) -> bool | None:
        """As of `Bench`; the image and the form are no matter."""
        del file, image
        program = folder / "mutant"
        routine = str(folder / self.work.named(ROUTINE))
        others = self.objects[tuple(flags)]
        command = [GCC.find(), *flags, f"-I{folder}", "-o", str(program), routine, *others]
        if run(command, folder).code:
            return None
        return subprocess.run([program], capture_output=True, check=False).returncode == 0
