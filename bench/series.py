"""A series of simulated units through the whole road: rate, cost per unit, scaling, the rerun.

CPU seconds (workers and their compilers, from /proc) stand beside wall seconds: on a machine that
others use too, only they say what a unit costs. Lines:

    cost     CPU seconds a unit, by tenths of the series: flat when it does not grow
    rate     units a minute, and a minute of CPU
    rerun    the same command with nothing changed, as share of the first, wall and CPU
    workers  one worker against two on `--scaling` units, on one core and on two, after each
             worker's first unit (which pays for its start). By CPU cost: 2 when a unit costs the
             same with two, whatever else the machine does

    python bench/series.py [--units N] [--scaling N] [--folder EXISTING] [--build FOLDER]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from itertools import pairwise
from pathlib import Path

from triaxcal.batch.local import cores, run_local
from triaxcal.batch.order import Outcome
from triaxcal.batch.plan import plan_work
from triaxcal.batch.run import run_series
from triaxcal.report.files import SOMETIMES
from triaxcal.report.series.page import series_files
from triaxcal.report.series.unit import make_unit
from triaxcal.simulation.series import write_series

ROOT = Path(__file__).resolve().parents[1]
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


def resident_mb() -> float:
    return max((int(v[21]) * PAGE_KB / 1024 for v in workers().values()), default=0.0)


def run(folder: Path, build: Path, jobs: int, log: Path | None = None) -> dict[str, list[float]]:
    """Wall and CPU seconds, and the largest worker in MB, at each unit."""
    seen: dict[str, float] = {}
    start, start_cpu = time.monotonic(), cpu_s({})
    rows: dict[str, list[float]] = {"wall": [0.0], "cpu": [0.0], "mb": [0.0]}

    def tell(outcome: Outcome) -> None:
        if outcome.refusal:
            print("refused ", outcome.refusal, flush=True)
        rows["wall"].append(time.monotonic() - start)
        rows["cpu"].append(cpu_s(seen) - start_cpu)
        rows["mb"].append(resident_mb())
        if log:
            log.write_text(json.dumps(rows), encoding="utf-8")

    work = plan_work(sorted(folder.iterdir()), build)
    series = run_series(
        work, build, make_unit, lambda m, o: run_local(m, o, jobs), sometimes=SOMETIMES, tell=tell
    )
    series_files(series)
    rows["wall"].append(time.monotonic() - start)
    rows["cpu"].append(cpu_s(seen) - start_cpu)
    return rows


def held_to(count: int, folder: Path, build: Path) -> tuple[float, float]:
    """Wall and CPU seconds a unit with `count` workers on as many cores, once each has made one."""
    every = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(every)[:count])
    try:
        rows = run(folder, build, count)
    finally:
        os.sched_setaffinity(0, every)
    made = len(rows["wall"]) - 2 - count
    wall, cpu = ((rows[name][-2] - rows[name][count]) / made for name in ("wall", "cpu"))
    return wall, cpu


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--units", type=int, default=40)
    parser.add_argument("--scaling", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--build", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder, build = options.folder, options.build or Path(scratch) / "build"
        if folder is None and options.units:
            folder = Path(scratch) / "units"
            list(write_series(ROOT / "units" / "AT-SIM", folder, options.units))
        if folder is not None:
            measure(folder, build)
        if options.scaling:
            small = Path(scratch) / "small"
            list(write_series(ROOT / "units" / "AT-SIM", small, options.scaling))
            scaling(small, Path(scratch), options.rounds)


def measure(folder: Path, build: Path) -> None:
    build.mkdir(parents=True, exist_ok=True)
    first = run(folder, build, cores(), build.with_name(f"{build.name}-times.json"))
    count = len(first["wall"]) - 2
    if count < 1:
        print("everything was done already: name another --build")
        return
    tenths = [round(k * count / 10) for k in range(11)]
    for name in ("cpu", "wall"):
        steps = [
            f"{(first[name][b] - first[name][a]) / (b - a):5.2f}"
            for a, b in pairwise(tenths)
            if b > a
        ]
        print(f"cost     {name:<5}" + " ".join(steps) + "  s a unit, by tenths")
    print(
        f"memory   {first['mb'][max(1, count // 10)]:.0f} MB the largest worker after a tenth, "
        f"{first['mb'][count]:.0f} MB at the end"
    )
    print(
        f"rate     {60 * count / first['wall'][-1]:.1f} units a minute on {cores()} workers, "
        f"{60 * count / first['cpu'][-1]:.1f} a minute of CPU ({count} units, "
        f"{first['wall'][-1]:.0f} s, {first['cpu'][-1]:.0f} CPU s)"
    )
    again = run(folder, build, cores())
    print(
        f"rerun    {100 * again['wall'][-1] / first['wall'][-1]:.2f} % wall, "
        f"{100 * again['cpu'][-1] / first['cpu'][-1]:.2f} % CPU   (limit 2)"
    )


def scaling(folder: Path, scratch: Path, rounds: int) -> None:
    ratios = []
    for k in range(rounds):
        one = held_to(1, folder, scratch / f"one-{k}")
        two = held_to(2, folder, scratch / f"two-{k}")
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
