"""How long a second `make calib-header` takes, as a multiple of the least it could.

The floor is Python started with numpy, scipy and jinja2 imported, and then the generated C
compiled by gcc with the project's flags: nothing read, fitted, proven or checked. Both are
measured in turn in this run; the medians are compared, of the wall clock and of CPU time (which
other work on the machine disturbs less). Both have their bytecode, as an installed package has,
even where PYTHONDONTWRITEBYTECODE is set.

    python bench/calib_header.py [UNIT ...]
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.compilers import find_compiler

ROOT = Path(__file__).resolve().parents[1]
ROUNDS = 9
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


def timed(commands: list[list[str]], folder: str) -> tuple[float, float]:
    """Wall and CPU seconds of commands run one after another."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    for command in commands:
        subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL, env=ENVIRONMENT)
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def measure(unit: str) -> None:
    triaxcal = str(Path(sys.executable).with_name("triaxcal"))
    with tempfile.TemporaryDirectory() as folder:
        ours = [[triaxcal, "calib", str(ROOT / "units" / unit)]]
        timed(ours, folder)
        generated = Path(folder) / "build" / unit
        floor = [
            [sys.executable, "-c", "import numpy, scipy, jinja2"],
            [*find_compiler().command, *FLAGS, "-shared", "-fPIC", "-o", "floor.so",
             f"-I{generated}", str(generated / "triax_comp.c"), str(generated / "triax_calib.c"),
             str(ROOT / "firmware_ref" / "triax_batch.c")],
        ]  # fmt: skip
        rounds = [(timed(ours, folder), timed(floor, folder)) for _ in range(ROUNDS)]
    for name, column in (("wall", 0), ("CPU", 1)):
        ours_s = statistics.median(r[0][column] for r in rounds)
        floor_s = statistics.median(r[1][column] for r in rounds)
        ratio = statistics.median(r[0][column] / r[1][column] for r in rounds)
        print(
            f"{unit:<14}{name:<6}calib-header {ours_s:6.2f} s   floor {floor_s:6.2f} s   "
            f"ratio {ratio:5.2f}   (limit 2.5, aim 2)"
        )


if __name__ == "__main__":
    for name in sys.argv[1:] or ["AT-CHERNIAK", "AT-SIM"]:
        measure(name)
