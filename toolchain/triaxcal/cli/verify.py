"""triaxcal verify: the delivered C of a unit before external tools."""

from __future__ import annotations

import sys
from pathlib import Path

from triaxcal.cli.options import command, example, say, unit_and_build


@command(epilog=example("triaxcal verify AT-SIM"))
@unit_and_build
def verify(unit: Path, build: Path) -> None:
    """Verify the generated C with independent tools.

    UNIT is calibrated as by `calib`. Then Gappa, Frama-C, cppcheck, gcc and clang check its C, and
    their results go into verification.json. The checks of a tool that is not installed count as not
    done. The exit code is 1 when a check failed.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.cli.progress import bar  # noqa: PLC0415

    with bar() as progress:
        done = triaxcal.verify_unit(unit, build, progress)
    say(done.summary)
    results = done.folder / "verification.json"
    say(f"\nresults in {results}; see docs/explanation/verification.md")
    sys.exit(done.failed)
