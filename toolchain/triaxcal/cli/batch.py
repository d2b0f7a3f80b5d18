"""`triaxcal batch`: many units at once."""

from __future__ import annotations

import logging
from pathlib import Path

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

import triaxcal
from triaxcal import SeriesResult, calibrate_series
from triaxcal.base.errors import RefusedError
from triaxcal.batch.order import Outcome
from triaxcal.batch.plan import Work, plan_work
from triaxcal.cli.options import UnitFolder, build_option, command, example, say


@command(
    epilog=example(
        "triaxcal batch units/* --build build/spring",
        "triaxcal batch AT-SIM AT-CHERNIAK",
        "triaxcal batch units/* --learn-priors",
    )
)
@click.argument("units", nargs=-1, required=True, type=UnitFolder(files=True))
@build_option("a folder for each unit, and the series' page")
@click.option(
    "--jobs",
    type=click.IntRange(1, 1024),
    help="Number of processes; one for each core by default.",
)
@click.option("--scheduler", help="Address of a Dask scheduler, as tcp://host:8786.")
@click.option(
    "--learn-priors",
    is_flag=True,
    help="Print the [priors] that recordings of poses of one type of sensor show; calibrate none.",
)
def batch(
    units: tuple[Path, ...],
    build: Path,
    jobs: int | None,
    scheduler: str | None,
    *,
    learn_priors: bool,
) -> None:
    """Calibrate many units; unchanged ones are not repeated.

    UNITS are the folders of the units, as units/*, accelerometers and IMUs. The series gets a page
    of its own.
    """
    if learn_priors:
        found = triaxcal.learn_priors(
            units,
            skipped=lambda path, why: click.echo(f"{path}: {why}; skipped", err=True),
        )
        say(found.toml)
        return
    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine; a cluster has its own workers")
    work = plan_work(units, build)
    for path, reason in work.skipped:
        click.echo(f"{path}: {reason}; skipped", err=True)
    if scheduler is not None:
        # A lost cluster is reported in one line; distributed would log tracebacks beside it.
        logging.disable(logging.CRITICAL)
    done = _run(work, build, jobs, scheduler)
    say(done.summary)
    if done.refused:
        raise RefusedError(
            "batch",
            f"{len(done.refused)} of {done.total} units refused",
            remedy=f"see above or {done.page}; run again when they are corrected",
        )


def _run(work: Work, build: Path, jobs: int | None, scheduler: str | None) -> SeriesResult:
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    made, interrupted = 0, False

    def report_finishing(count: int) -> None:
        nonlocal interrupted
        interrupted = True
        units = "1 unit" if count == 1 else f"{count} units"
        click.echo(
            f"interrupted: finishing {units} under way; interrupt again to stop at once", err=True
        )

    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("units", total=work.total, completed=len(work.done))

        def report(outcome: Outcome) -> None:
            nonlocal made
            made += 1
            bar.advance(task)
            if outcome.refusal:
                console.print(
                    f"refused  {outcome.refusal}", markup=False, highlight=False, soft_wrap=True
                )

        try:
            return calibrate_series(
                work, build, jobs=jobs, scheduler=scheduler, outcome=report,
                finishing=report_finishing,
            )  # fmt: skip
        except (KeyboardInterrupt, RuntimeError) as stop:
            # A second interrupt inside of a lock comes out of `threading` as a RuntimeError.
            if isinstance(stop, RuntimeError) and not interrupted:
                raise
            raise RefusedError(
                "batch",
                f"interrupted; {len(work.done) + made} of {work.total} units are done",
                remedy="run it again to go on",
            ) from None
