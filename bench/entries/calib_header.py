"""How much a second `make calib-header` takes, beside the least it could.

The floor is Python started with numpy, scipy and jinja2 imported, and then the generated C compiled
by gcc with the project's flags: nothing read, fitted, proven or checked.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from measuring import ROOT, UNITS, Bench, Figure, alternately, pick, run, triaxcal

from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.compilers import find_compiler

_FLOOR = "Python with numpy, scipy and jinja2 imported, and one gcc run on the generated C"


def measure(size: str) -> list[Figure]:
    names = pick(size, ["AT-CHERNIAK"], ["AT-CHERNIAK", "AT-SIM"], ["AT-CHERNIAK", "AT-SIM"])
    return [_figure(name, pick(size, 1, 3, 9)) for name in names]


def _figure(unit: str, rounds: int) -> Figure:
    with tempfile.TemporaryDirectory() as folder:
        ours = triaxcal("calib", UNITS / unit)
        run(ours, folder)
        made = Path(folder) / "build" / unit
        sources = [made / "triax_comp.c", made / "triax_calib.c"]
        sources += [ROOT / "firmware_ref" / "triax_batch.c"]
        compile_c = [
            *find_compiler().command, *FLAGS, "-shared", "-fPIC", "-o", "floor.so", f"-I{made}",
            *sources,
        ]  # fmt: skip

        def floor() -> None:
            run([sys.executable, "-c", "import numpy, scipy, jinja2"], folder)
            run(compile_c, folder)

        ours_s, floor_s = alternately(rounds, lambda: run(ours, folder), floor)
    return Figure(f"`make calib-header UNIT={unit}`", ours_s, "s", _FLOOR, floor_s)


ENTRY = Bench(
    name="calib_header",
    label="One unit: make calib-header",
    doc="Everything for one unit: read, fitted, proven, 2.4 million vectors compared bit for bit, "
    "diagnosed where there is a doubt, passport and files written.",
    measure=measure,
    figures=("`make calib-header UNIT=AT-CHERNIAK`", "`make calib-header UNIT=AT-SIM`"),
    sizes="3 rounds, 9 with --full",
    rank=10,
)
