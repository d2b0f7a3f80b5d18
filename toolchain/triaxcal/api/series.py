"""`calibrate_series`: many units at once, on this machine's cores or on a Dask cluster."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.batch import journal
from triaxcal.batch.cluster import connect, run_cluster, workers
from triaxcal.batch.local import cores, run_local
from triaxcal.batch.order import Outcome, Runner
from triaxcal.batch.plan import Work, plan_work
from triaxcal.batch.run import run_series
from triaxcal.report.files import SOMETIMES
from triaxcal.report.series.page import PAGE_FILE, series_files
from triaxcal.report.series.summary import series_summary
from triaxcal.report.series.unit import make_unit
from triaxcal.unit.description import read_unit

if TYPE_CHECKING:
    from triaxcal.fitting.recorded.learned import LearnedPriors


@dataclass(frozen=True)
class SeriesResult:
    """What became of a series.

    Attributes
    ----------
    page : Path
        The page about all units.
    refused : dict
        Why units were refused, by name.
    total : int
        Units in all.
    summary : str
        The text that the command line prints.
    """

    page: Path
    refused: dict[str, str]
    total: int
    summary: str


def calibrate_series(
    units: Sequence[str | Path] | Work,
    build: str | Path = "build",
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    outcome: Callable[[Outcome], None] = lambda _: None,
    finishing: Callable[[int], None] = lambda _: None,
) -> SeriesResult:
    """Calibrate many units; those whose files have not changed are not made again.

    Parameters
    ----------
    units : paths, or a Work
        Folders of the units; or what `plan_work` made of them.
    build : path
        Receives a folder for each unit, and the page of the series.
    jobs : int or None
        Processes; None is one for each core.
    scheduler : str or None
        Address of a Dask scheduler, in place of `jobs`.
    outcome : callable
        Called with each unit when its files are in place, or with its refusal.
    finishing : callable
        Called at an interrupt with the number of units that are finished before it is raised.

    Raises
    ------
    RefusedError
        When there is no unit, the journal cannot be written, or the cluster is lost.
    """
    if jobs is not None and jobs < 1:
        raise RefusedError("jobs", f"found {jobs}", expected="1 or more, or None")
    target = Path(build)
    work = units if isinstance(units, Work) else plan_work([Path(u) for u in units], target)
    start = time.monotonic()
    with _runner(jobs, scheduler, finishing) as (run, width):
        series = run_series(work, target, make_unit, run, sometimes=SOMETIMES, report=outcome)
    seconds = time.monotonic() - start
    target.mkdir(parents=True, exist_ok=True)
    if series.made:
        journal.rewrite(target, ({**journal.read_journal(target), **series.entries}).values())
    renew(series_files(series, target), target)
    page = target / PAGE_FILE
    text = series_summary(series, len(work.done), seconds, width, str(page))
    return SeriesResult(page, dict(series.refused), work.total, text)


def learn_priors(
    units: Sequence[str | Path], *, skipped: Callable[[str, str], None] = lambda *_: None
) -> LearnedPriors:
    """Scales of cross terms, scale factors and squares of a type of sensor, from a series of it.

    Parameters
    ----------
    units : paths
        Folders of units with recordings of poses.
    skipped : callable
        Called with the folder and the reason where a unit is not used.

    Returns
    -------
    LearnedPriors
        `toml` is the section [priors] for unit.toml.

    Raises
    ------
    RefusedError
        When fewer than two units can be used.
    """
    from triaxcal.fitting.recorded.learned import learn, unit_poses  # noqa: PLC0415

    found = []
    for path in sorted(dict.fromkeys(map(Path, units))):
        try:
            unit = read_unit(path)
            layout = unit.recording
            if layout is None or layout.faces or layout.angles is not None:
                skipped(str(path), "no recording of poses of which only |a| = g is known")
                continue
            found.append(unit_poses(unit, layout, path))
        except RefusedError as refusal:
            skipped(str(path), str(refusal))
    if len(found) < 2:
        raise RefusedError(
            "learn_priors",
            f"{len(found)} unit{'s' * (len(found) != 1)} with usable poses",
            expected="two and more of one type of sensor",
            remedy="name the folders of a series",
        )
    return learn(found)


@contextmanager
def _runner(
    jobs: int | None, scheduler: str | None, finishing: Callable[[int], None]
) -> Iterator[tuple[Runner, int]]:
    """What makes the units of a series, here or on a cluster, and how many at a time."""
    if scheduler is None:
        width = jobs or cores()
        yield (lambda make, orders: run_local(make, orders, width, finishing)), width
        return
    client = connect(scheduler)
    try:
        yield (lambda make, orders: run_cluster(client, make, orders)), workers(client)
    finally:
        client.close()
