"""A series of simulated units through the whole road: what a unit costs, scaling, the rerun.

Processor seconds (workers and their compilers, from /proc) stand beside wall seconds: on a machine
that others use too, only they say what a unit costs. With --full: a thousand units, the cost by
tenths, memory, and one worker against two on as many cores, after each worker's first unit, which
pays for its start. Ctrl-C stops the full one; the same command goes on where it was.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from pathlib import Path

from measuring import ROOT, Bench, Figure, pick, run, spent, triaxcal
from rich.console import Console
from rich.progress import Progress

from triaxcal.batch.local import cores, run_local
from triaxcal.batch.order import Outcome
from triaxcal.batch.plan import plan_work
from triaxcal.batch.run import run_series
from triaxcal.report.files import SOMETIMES
from triaxcal.report.series.page import series_files
from triaxcal.report.series.unit import make_unit
from triaxcal.simulation.series import write_series

FOLDER = ROOT / "build" / "bench-series"
AT_SIM = ROOT / "units" / "AT-SIM"
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024


def fields(pid: str) -> list[str]:
    text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    return text[text.rindex(")") + 2 :].split()


def workers() -> dict[str, list[str]]:
    """Statistics of this process' children, by process id."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                values = fields(entry.name)
            except OSError:
                continue
            if values[1] == str(os.getpid()):
                found[entry.name] = values
    return found


def workers_cpu_s(seen: dict[str, float]) -> float:
    """CPU seconds so far of all workers there have been, their compilers, and this process."""
    for pid, values in workers().items():
        seen[pid] = sum(map(int, values[11:15])) * TICK_S
    return sum(seen.values()) + time.process_time()


def resident_mb() -> tuple[float, float]:
    """Of the largest worker, and of this process."""
    own = int(fields("self")[21])
    largest = max((int(v[21]) for v in workers().values()), default=0)
    return largest * PAGE_KB / 1024, own * PAGE_KB / 1024


def progress() -> Progress:
    console = Console(stderr=True)
    return Progress(console=console, disable=not console.is_terminal, transient=True)


Row = dict[str, float]
"""What one unit took since the one before: wall and CPU seconds; memory in MB when it was made."""


def run_all(units: Path, build: Path, jobs: int, label: str, log: Path | None = None) -> list[Row]:
    """One row a unit made, and one for what comes after the last; `log` keeps them if stopped."""
    seen: dict[str, float] = {}
    rows: list[Row] = []
    start, start_cpu = time.monotonic(), workers_cpu_s({})
    work = plan_work(sorted(units.iterdir()), build)
    if log and work.done:
        rows = json.loads(log.read_text(encoding="utf-8"))[: len(work.done)]

    def row() -> None:
        nonlocal start, start_cpu
        now, cpu, (worker, own) = time.monotonic(), workers_cpu_s(seen), resident_mb()
        rows.append({"wall": now - start, "cpu": cpu - start_cpu, "worker": worker, "own": own})
        start, start_cpu = now, cpu

    with progress() as bar:
        task = bar.add_task(label, total=work.total, completed=len(work.done))

        def tell(outcome: Outcome) -> None:
            if outcome.refusal:
                print("refused ", outcome.refusal, flush=True)
            row()
            bar.advance(task)
            if log:
                log.write_text(json.dumps(rows), encoding="utf-8")

        series = run_series(
            work,
            build,
            make_unit,
            lambda m, o: run_local(m, o, jobs),
            sometimes=SOMETIMES,
            report=tell,
        )
    series_files(series)
    row()
    return rows


def total(rows: list[Row], name: str) -> float:
    return sum(row[name] for row in rows)


def mean(rows: list[Row], name: str) -> float:
    return total(rows, name) / len(rows)


def simulated(folder: Path, count: int) -> Path:
    """So many units in `folder`, written once."""
    done = folder.with_name(f"{folder.name}-{count}")
    if not done.exists():
        shutil.rmtree(folder, ignore_errors=True)
        with progress() as bar:
            list(bar.track(write_series(AT_SIM, folder, count), count, description="simulating"))
        done.touch()
    return folder


def held_to(count: int, units: Path, build: Path) -> tuple[float, float]:
    """Wall and CPU seconds a unit with `count` workers on as many cores, once each has made one."""
    every = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(every)[:count])
    shutil.rmtree(build, ignore_errors=True)
    try:
        rows = run_all(units, build, count, f"{count} worker(s)")[count:-1]
    finally:
        os.sched_setaffinity(0, every)
    return mean(rows, "wall"), mean(rows, "cpu")


def measure(size: str) -> list[Figure]:
    count = pick(size, 2, 12, 1000)
    units, build = simulated(FOLDER / "units", count), FOLDER / "made"
    log = FOLDER / "times.json"
    if not log.exists():
        shutil.rmtree(build, ignore_errors=True)
    first = run_all(units, build, cores(), "first run", log if size == "full" else None)
    made, cpu = first[:-1], total(first, "cpu")
    each = mean(_later(made), "cpu")
    again = run_all(units, build, cores(), "rerun")
    if len(again) > 1:
        raise RuntimeError(f"{len(again) - 1} units were made again: refused or damaged")
    with tempfile.TemporaryDirectory() as folder:
        unit = next(iter(sorted(units.iterdir())))
        alone = spent(lambda: run(triaxcal("calib", unit), folder))
    found = [
        Figure(_EACH, each, "CPU s", "`triaxcal calib` on one of them", alone),
        Figure(_RATE, 120.0 / each, "a minute", "asked for", 90.0, "rate"),
        Figure(_AGAIN, total(again, "cpu"), "CPU s", f"the first run of {count} units", cpu),
    ]
    if size == "full":
        found += _by_size(made) + _scaling(simulated(FOLDER / "few", 40))
    shutil.rmtree(FOLDER)
    return found


def _later(made: list[Row]) -> list[Row]:
    """Without the first unit of each worker, which pays for its start."""
    return made[cores() :] if len(made) > 2 * cores() else made


def _by_size(made: list[Row]) -> list[Figure]:
    tenth = len(made) // 10
    return [
        Figure("the last hundred units", mean(made[-100:], "cpu"), "CPU s a unit",
               "the first hundred", mean(made[:100], "cpu")),
        Figure("memory of the largest worker at the end", made[-1]["worker"], "MB",
               "after a tenth", made[tenth]["worker"]),
    ]  # fmt: skip


def _scaling(units: Path) -> list[Figure]:
    one = held_to(1, units, FOLDER / "one")
    two = held_to(2, units, FOLDER / "two")
    return [
        Figure("two workers on two cores, by the clock", two[0], "s a unit", "one on one", one[0]),
        Figure("two workers on two cores", two[1], "CPU s a unit", "one on one", one[1]),
    ]


_EACH = "a unit of a series"
_RATE = "units of a series on two cores that do nothing else, by their processor time"
_AGAIN = "the same command with nothing changed"
ENTRY = Bench(
    name="series",
    label="A series",
    doc="Simulated units: seven temperatures, 78 dwells, check dwells at six temperatures, from a "
    "rig with tilts of arcseconds. Each is made in full, as `make calib-header` makes it.",
    measure=measure,
    figures=(_EACH, _RATE, _AGAIN),
    sizes="12 units; 1000, memory and scaling with --full, which takes half an hour",
    rank=20,
)
