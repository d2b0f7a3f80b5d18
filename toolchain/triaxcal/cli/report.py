"""`triaxcal report`: a test report of a unit."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import command, example, say, unit_and_build


@command(epilog=example("triaxcal report AT-0042", "triaxcal report AT-0042 --standard ieee-1293"))
@unit_and_build
@click.option(
    "--standard", default="ieee-1293", show_default=True, help="Whose figures and symbols to use."
)
def report(unit: Path, build: Path, standard: str) -> None:
    """Report what was measured of a unit, as test houses do.

    Model equation, repeatability, warm-up, hysteresis, temperature sensitivities, noise, composite
    error and vibration rectification, each with its interval and how it was measured, or why it
    was not. Recordings of tests are stated in unit.toml as [test.NAME], vibrations as
    [vibration.NAME]. The page and its JSON go into reports/UNIT below the build folder.
    """
    import triaxcal  # noqa: PLC0415

    done = triaxcal.make_test_report(triaxcal.read_unit(unit), standard)
    folder = done.write(build)
    say(f"{done.summary}\n\nreport    {folder / 'report.html'}")
