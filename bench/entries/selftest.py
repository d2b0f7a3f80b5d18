"""What the self-test adds to the compilation of a unit's C."""

from __future__ import annotations

import tempfile
from pathlib import Path

from measuring import UNITS, Bench, Figure, alternately, pick, run, triaxcal

from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.compilers import find_compiler


def measure(size: str) -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        run(triaxcal("calib", UNITS / "AT-SIM"), folder)
        made = Path(folder) / "build" / "AT-SIM"

        def compiled(*names: str) -> None:
            for name in names:
                source = made / f"triax_{name}.c"
                run([*find_compiler().command, *FLAGS, "-c", source, "-o", "made.o"], folder)

        rounds = pick(size, 1, 9, 25)
        test, routine = alternately(
            rounds, lambda: compiled("selftest"), lambda: compiled("comp", "calib")
        )
    return [Figure(_TEST, 1e3 * test, "CPU ms", "triax_comp.c and triax_calib.c", 1e3 * routine)]


_TEST = "gcc on triax_selftest.c at -O2"
ENTRY = Bench(
    name="selftest",
    label="Compiling the self-test",
    doc="The self-test of AT-SIM beside the routine and its constants.",
    measure=measure,
    figures=(_TEST,),
    rank=32,
)
