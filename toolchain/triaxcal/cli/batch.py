"""`triaxcal batch`: many units at once."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
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

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.batch import journal
from triaxcal.batch.cluster import connect, run_cluster, workers
from triaxcal.batch.local import cores, run_local
from triaxcal.batch.order import Make, Order, Outcome, Runner
from triaxcal.batch.plan import Work, plan_work
from triaxcal.batch.run import Series, run_series
from triaxcal.cli.options import UnitFolder, example, say
from triaxcal.report.files import SOMETIMES
from triaxcal.report.series.page import PAGE_FILE, series_files
from triaxcal.report.series.summary import series_summary
from triaxcal.report.series.unit import make_unit


@click.command(
    epilog=example(
        "triaxcal batch units/* --build build/spring", "triaxcal batch AT-SIM AT-CHERNIAK"
    )
)
@click.argument("units", nargs=-1, required=True, type=UnitFolder(files=True))
@click.option(
    "--build",
    type=click.Path(path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder that receives a folder for each unit, and the series' page.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1, 1024),
    help="Number of processes; one for each core by default.",
)
@click.option("--scheduler", help="Address of a Dask scheduler, as tcp://host:8786.")
def batch(units: tuple[Path, ...], build: Path, jobs: int | None, scheduler: str | None) -> None:
    """Calibrate many units; unchanged ones are not repeated.

    UNITS are folders of units, or folders that contain them. The series gets a page of its own.
    """
    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine; a cluster has its own workers")
    work = plan_work(units, build)
    for path, reason in work.skipped:
        click.echo(f"{path}: {reason}; skipped", err=True)
    start = time.monotonic()
    if scheduler is None:
        width = jobs or cores()
        series = _run(work, build, _local(width))
    else:
        # A lost cluster is reported in one line; distributed would log tracebacks beside it.
        logging.disable(logging.CRITICAL)
        client = connect(scheduler)
        try:
            width = workers(client)
            series = _run(work, build, lambda make, orders: run_cluster(client, make, orders))
        finally:
            client.close()
    seconds = time.monotonic() - start
    build.mkdir(parents=True, exist_ok=True)
    if series.made:
        journal.rewrite(build, ({**journal.read_journal(build), **series.entries}).values())
    renew(series_files(series), build)
    page = build / PAGE_FILE
    say(series_summary(series, len(work.done), seconds, width, str(page)))
    if series.refused:
        raise RefusedError(
            "batch",
            f"{len(series.refused)} of {work.total} units refused",
            remedy=f"see above or {page}; run again when they are corrected",
        )


def _local(jobs: int) -> Runner:
    def runner(make: Make, orders: list[Order]) -> Iterator[Outcome]:
        return run_local(make, orders, jobs, _report_finishing)

    return runner


def _report_finishing(count: int) -> None:
    units = "1 unit" if count == 1 else f"{count} units"
    click.echo(
        f"interrupted: finishing {units} under way; interrupt again to stop at once", err=True
    )


def _run(work: Work, build: Path, runner: Runner) -> Series:
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    made = 0
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("units", total=work.total, completed=len(work.done))

        def tell(outcome: Outcome) -> None:
            nonlocal made
            made += 1
            bar.advance(task)
            if outcome.refusal:
                console.print(
                    f"refused  {outcome.refusal}", markup=False, highlight=False, soft_wrap=True
                )

        try:
            return run_series(work, build, make_unit, runner, sometimes=SOMETIMES, tell=tell)
        except KeyboardInterrupt:
            raise RefusedError(
                "batch",
                f"interrupted; {len(work.done) + made} of {work.total} units are done",
                remedy="run it again to go on",
            ) from None
