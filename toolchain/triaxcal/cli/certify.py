"""triaxcal certify: the error bound of a unit as theorems that Coq checks."""

from __future__ import annotations

import sys
from pathlib import Path

from triaxcal.cli.options import command, example, say, unit_and_build


@command(epilog=example("triaxcal certify AT-SIM"))
@unit_and_build
def certify(unit: Path, build: Path) -> None:
    """Prove the error bound of the C in Coq.

    UNIT is calibrated as by `calib`. Gappa writes a proof for each axis and segment, and Coq checks
    it: a few minutes. The accepted files go into certificates/UNIT below the build folder, with a
    note on how to check them without triaxcal. Needs gappa and coqc; without them nothing is
    proven, and that is said. The exit code is 1 when Coq refuses a file.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.cli.progress import bar  # noqa: PLC0415

    with bar() as progress:
        done = triaxcal.certify(unit, build, progress)
    say(done.summary)
    if done.certificates is not None:
        say(f"\ntheorems in {done.certificates}; see docs/explanation/certificate.md")
    sys.exit(done.failed)
