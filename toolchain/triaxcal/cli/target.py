"""`triaxcal target`: the generated C on other cores."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from triaxcal.cli.options import HELP, UnitFolder, build_option, example, say


@click.group(context_settings=HELP, epilog=example("triaxcal target test AT-SIM"))
def target() -> None:
    """Test and measure the generated C on other processors.

    Cortex-M, RISC-V and two big-endian cores are emulated by QEMU, an AVR by simavr.
    """


@target.command(epilog=example("triaxcal target test", "triaxcal target test AT-SIM"))
@click.argument("unit", required=False, type=UnitFolder())
@build_option("targets.json", "build/targets")
def test(unit: Path | None, build: Path) -> None:
    """Compare the C on every core with Python, bit for bit.

    Every compiler and optimisation is tried, with the C of UNIT or, without it, of the shipped
    units in units/. Of an IMU these are the routines of both triads. The exit code is 1 unless
    every build was done and passed.
    """
    from triaxcal.base.publish import publish  # noqa: PLC0415  numpy and jinja2 only when needed
    from triaxcal.cli.progress import bar  # noqa: PLC0415
    from triaxcal.targets.matrix import (  # noqa: PLC0415
        PASSED,
        Outcome,
        run_builds,
        shipped_builds,
        unit_builds,
    )
    from triaxcal.targets.shapes import shipped_cases, unit_cases  # noqa: PLC0415
    from triaxcal.targets.table import counts, matrix_json, matrix_table  # noqa: PLC0415

    if unit:
        with bar() as calibrating:
            builds = [b for case in unit_cases(unit, calibrating) for b in unit_builds(case)]
    else:
        builds = shipped_builds(shipped_cases(Path("units")))

    def progress(outcome: Outcome, done: int) -> None:
        if outcome.status != PASSED or done % 10 == 0 or sys.stderr.isatty():
            end = "\r" if sys.stderr.isatty() and outcome.status == PASSED else "\n"
            line = f"{done}/{len(builds)} {outcome.status}: {outcome.build.label}"
            click.echo(f"{line:100}{end}", nl=False, err=True)

    outcomes = run_builds(builds, progress)
    publish({"targets.json": matrix_json(outcomes).encode()}, build)
    say(matrix_table(outcomes))
    if counts(outcomes)[PASSED] != len(outcomes):
        sys.exit(1)


@target.command(epilog=example("triaxcal target bench --build out"))
@build_option("bench.json and bench.md", "build/target-bench")
@click.option(
    "--page",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="Markdown page whose generated table is replaced.",
)
def bench(build: Path, page: Path | None) -> None:
    """Count instructions, flash, RAM and stack of a call.

    Each core is measured with the generated C and with the same in floating point. The exit code is
    1 unless everything was measured.
    """
    from triaxcal.base.publish import publish  # noqa: PLC0415  numpy and jinja2 only when needed
    from triaxcal.targets.bench import Cost, compiler_versions, run_bench  # noqa: PLC0415
    from triaxcal.targets.bench_angles import (  # noqa: PLC0415
        AnglesCost,
        angles_markdown,
        angles_rows,
        run_angles_bench,
    )
    from triaxcal.targets.bench_table import (  # noqa: PLC0415
        bench_json,
        markdown,
        put_between_markers,
    )
    from triaxcal.targets.shapes import shipped_cases  # noqa: PLC0415

    def progress(cost: Cost) -> None:
        click.echo(
            f"{cost.failure or 'measured'}: {cost.subject.label}, {cost.core.name}", err=True
        )

    def progress_of_angles(cost: AnglesCost) -> None:
        click.echo(f"{cost.failure or 'measured'}: {cost.what}, {cost.core.name}", err=True)

    cases = shipped_cases(Path("units"))
    costs = run_bench(cases, progress)
    angles = run_angles_bench(cases, progress_of_angles)
    compilers = compiler_versions()
    table = f"{markdown(costs, compilers)}\n\n{angles_markdown(angles)}"
    document = bench_json(costs, compilers, angles_rows(angles))
    files = {"bench.json": document, "bench.md": table + "\n"}
    publish({name: text.encode() for name, text in files.items()}, build)
    if page:
        text = page.read_text(encoding="utf-8")
        page.write_text(put_between_markers(text, table, str(page)), encoding="utf-8")
    click.echo(table)
    if any(c.failure for c in costs) or any(c.failure for c in angles):
        sys.exit(1)
