"""A series of simulated units through the whole road: rate, cost per unit, scaling, the rerun.

CPU seconds (workers and their compilers, from /proc) stand beside wall seconds: on a machine that
others use too, only they say what a unit costs. Lines:

    machine  cores, and the load before and after: wall seconds are for a machine with nothing else
    cost     seconds a unit, by tenths of the series, and the last hundred against the first
    memory   the largest worker, and the process that hands the units out
    rate     units a minute, a minute and core, and a minute of CPU
    rerun    the same command with nothing changed, as share of the first, wall and CPU
    workers  one worker against two on `--scaling` units, on one core and on two, after each
             worker's first unit (which pays for its start). By CPU cost: 2 when a unit costs the
             same with two, whatever else the machine does

Ctrl-C stops it; the same command goes on where it was, until all is told. Then it begins anew.

    python bench/series.py [--units N] [--scaling N] [--rounds N]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import sys
import time
from itertools import pairwise
from pathlib import Path

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

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "bench-series"
AT_SIM = ROOT / "units" / "AT-SIM"
HUNDRED = 100
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


def cpu_s(seen: dict[str, float]) -> float:
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


def run(units: Path, build: Path, jobs: int, label: str, log: Path | None = None) -> list[Row]:
    """One row a unit made, and one for what comes after the last; `log` keeps them if stopped."""
    seen: dict[str, float] = {}
    rows: list[Row] = []
    start, start_cpu = time.monotonic(), cpu_s({})
    work = plan_work(sorted(units.iterdir()), build)
    if log and work.done:
        rows = json.loads(log.read_text(encoding="utf-8"))[: len(work.done)]

    def row() -> None:
        nonlocal start, start_cpu
        now, cpu, (worker, own) = time.monotonic(), cpu_s(seen), resident_mb()
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
        rows = run(units, build, count, f"{count} worker(s)")[count:-1]
    finally:
        os.sched_setaffinity(0, every)
    return mean(rows, "wall"), mean(rows, "cpu")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--units", type=int, default=40)
    parser.add_argument("--scaling", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    before = os.getloadavg()[0]
    try:
        if options.units:
            measure(simulated(FOLDER / "units", options.units), FOLDER / "made")
        if options.scaling:
            scaling(simulated(FOLDER / "few", options.scaling), options.rounds)
    except KeyboardInterrupt:
        sys.exit("stopped; the same command goes on")
    print(f"machine  {cores()} cores, load {before:.1f} before and {os.getloadavg()[0]:.1f} after")
    shutil.rmtree(FOLDER)


def measure(units: Path, build: Path) -> None:
    log = FOLDER / "times.json"
    if not log.exists():
        shutil.rmtree(build, ignore_errors=True)
    first = run(units, build, cores(), "first run", log)
    made, count = first[:-1], len(first) - 1
    log.write_text(json.dumps(made), encoding="utf-8")
    tenths = [round(k * count / 10) for k in range(11)]
    for name in ("cpu", "wall"):
        steps = [f"{mean(made[a:b], name):5.2f}" for a, b in pairwise(tenths) if b > a]
        print(f"cost     {name:<5}" + " ".join(steps) + "  s a unit, by tenths")
    if count >= 2 * HUNDRED:
        ratios = [
            f"{mean(made[-HUNDRED:], name) / mean(made[:HUNDRED], name):.3f} {name}"
            for name in ("cpu", "wall")
        ]
        print(f"cost     last {HUNDRED} units against the first {HUNDRED}: " + ", ".join(ratios))
    early, late = made[max(0, count // 10 - 1)], made[-1]
    print(
        f"memory   {early['worker']:.0f} MB the largest worker after a tenth, {late['worker']:.0f} "
        f"MB at the end; this process {early['own']:.0f} and {late['own']:.0f} MB"
    )
    wall, cpu = total(first, "wall"), total(first, "cpu")
    print(
        f"rate     {60 * count / wall:.1f} units a minute on {cores()} workers, "
        f"{60 * count / wall / cores():.1f} a worker, {60 * count / cpu:.1f} a minute of CPU "
        f"({count} units, {wall:.0f} s, {cpu:.0f} CPU s)"
    )
    again = run(units, build, cores(), "rerun")
    if len(again) > 1:
        sys.exit(f"rerun    made {len(again) - 1} units again: they were refused or damaged")
    print(
        f"rerun    {100 * total(again, 'wall') / wall:.2f} % wall, "
        f"{100 * total(again, 'cpu') / cpu:.2f} % CPU   (limit 2)",
        flush=True,
    )


def scaling(units: Path, rounds: int) -> None:
    ratios = []
    for _ in range(rounds):
        one = held_to(1, units, FOLDER / "one")
        two = held_to(2, units, FOLDER / "two")
        ratios.append((one[0] / two[0], 2.0 * one[1] / two[1]))
        print(
            f"         one worker {one[0]:.2f} s and {one[1]:.2f} CPU s a unit, two "
            f"{two[0]:.2f} s and {two[1]:.2f} CPU s"
        )
    print(
        f"workers  two give {statistics.median(r[0] for r in ratios):.2f} times one, wall; "
        f"{statistics.median(r[1] for r in ratios):.2f} by CPU cost   (limit 1.8)"
    )


if __name__ == "__main__":
    main()
