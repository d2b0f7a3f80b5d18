"""How often `triaxcal diagnose` is right on simulated units, in pieces that can be put together.

    python bench/diagnosis.py run --units 40 --seed-start 0 >> campaign.jsonl
    python bench/diagnosis.py run --units 200 --spread >> campaign.jsonl
    python bench/diagnosis.py tables campaign.jsonl

`run` writes one line of JSON a unit: its fault, size, temperatures, checks, seed, and the causes of
the answer. A cell is one size, one number of temperatures, with or without check dwells; `--units`
are measured in each cell, or with `--spread` in all of them together. `tables` reads such lines,
drops repeated ones, and writes a table of the confusions for each cell.

The units are those of tests/diagnosis_units.py, which share nothing with the package's models.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from diagnosis_units import (
    ARC,
    CAUSE_OF,
    FAULTS,
    NEEDS_CHECKS,
    UNLISTED,
    WITHOUT_SIZE,
    simulated,
)
from triaxcal.diagnosis import diagnose
from triaxcal.diagnosis.causes.registry import CAUSES

SIZES_G = {"0.3-0.5 mg": (0.3e-3, 0.5e-3), "1-2 mg": (1e-3, 2e-3), "10-80 mg": (10e-3, 80e-3)}
ONE_SIZE = "1-2 mg"
HARSH = {"bump_g": 0.2e-3, "noise": 1.5, "squareness": 30 * ARC}
"""What a sound unit may have: bumps in its curves, more noise than stated, a rig not square."""
KEY = ("fault", "size", "temps", "checks", "seed")


def diagnosed(fault: str, size: str, temps: int, checks: bool, seed: int) -> dict[str, Any]:
    """One unit: what it has, and the answer."""
    low, high = SIZES_G[size]
    size_g = float(np.exp(np.random.default_rng(seed).uniform(np.log(low), np.log(high))))
    more: dict[str, Any] = dict(HARSH) if fault == "none" else {}
    if fault == "gain":
        more["more"] = "[sensor]\nnominal_v_per_g = [0.5, 0.5, 0.5]\nnominal_tolerance = 0.05\n"
    unit, measurements, _ = simulated(fault, size_g, seed, temps, checks=checks, **more)
    started = time.process_time()
    found = diagnose(unit, measurements)
    seconds = time.process_time() - started
    return {
        "fault": fault, "size": size, "temps": temps, "checks": checks, "seed": seed,
        "answer": [s.cause for s in found.answer], "doubtful": found.clear,
        "best": found.answer[0].name if found.answer else "", "ms": round(1e3 * seconds),
    }  # fmt: skip


def cells(given: argparse.Namespace, fault: str) -> list[tuple[str, int, bool]]:
    """Sizes, numbers of temperatures and checks of a fault."""
    one = fault in WITHOUT_SIZE or fault == "none"
    sides = {"yes": [True], "no": [False], "both": [True, False]}[given.checks]
    sides = [side for side in sides if side or fault not in NEEDS_CHECKS]
    return list(product([ONE_SIZE] if one else given.sizes, given.temps, sides))


def run(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Diagnose the units of all faults."""
    for fault in given.faults:
        units = given.sound if fault == "none" and given.sound is not None else given.units
        seeds = range(given.seed_start, given.seed_start + units)
        mine = cells(given, fault)
        if given.spread:
            pairs: Iterable[Any] = ((mine[seed % len(mine)], seed) for seed in seeds)
        else:
            pairs = product(mine, seeds)
        for (size, temps, checks), seed in pairs:
            yield diagnosed(fault, size, temps, checks, seed)


def row(fault: str, units: list[dict[str, Any]]) -> str:
    """One row of a table: how often the true cause is first, or in the answer, and what else is.

    Of a fault that no cause of the list is, a symptom is right. Wrong is another cause named alone
    and with odds of 20 to 1 against a sound unit.
    """
    symptoms = {c.name for c in CAUSES if c.symptom}
    true = {CAUSE_OF[fault]} if fault in CAUSE_OF else symptoms
    firsts = Counter[str]()
    right = named = wrong = alarms = 0
    for unit in units:
        answer = unit["answer"] or ["none"]
        firsts[answer[0]] += 1
        right += answer[0] in true
        named += bool(true & {*answer})
        wrong += unit["doubtful"] and len({*answer}) == 1 and answer[0] not in true | symptoms
        alarms += unit["doubtful"]
    n = len(units)
    others = ", ".join(f"{k} {v}" for k, v in firsts.most_common() if k not in true)
    if fault == "none":
        wrong = alarms
        right, named, others = n - alarms, n - alarms, f"{alarms} with odds above 20; {others}"
    share = [f"{100 * value / n:.0f} %" for value in (right, named, wrong)]
    return f"| `{fault}` | {n} | {' | '.join(share)} | {others} |"


def tables(files: Iterable[Path]) -> str:
    """A table for each cell, of all lines of some files."""
    lines = [json.loads(line) for f in files for line in f.read_text().splitlines()]
    units = {tuple(unit[k] for k in KEY): unit for unit in lines}.values()
    grouped: dict[tuple[int, bool, str], dict[str, list[dict[str, Any]]]] = {}
    for unit in units:
        cell = unit["temps"], unit["checks"], unit["size"]
        grouped.setdefault(cell, defaultdict(list))[unit["fault"]].append(unit)
    order = {name: k for k, name in enumerate([*FAULTS, *UNLISTED])}
    text = []
    for temps, checks, size in sorted(
        grouped, key=lambda c: (c[0], not c[1], list(SIZES_G).index(c[2]))
    ):
        text.append(
            f"\n{temps} temperatures, {'with' if checks else 'without'} check dwells, {size}:\n"
        )
        text.append("| fault | units | first | in the answer | wrong name alone | else first |")
        text.append("|---|---|---|---|---|---|")
        mine = grouped[temps, checks, size]
        text += [row(fault, mine[fault]) for fault in sorted(mine, key=order.__getitem__)]
    ms = [unit["ms"] for unit in units]
    text.append(f"\n{len(ms)} units, {np.mean(ms):.0f} ms of CPU time each.")
    return "\n".join(text)


def main() -> None:
    """Run, or write tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    todo = parser.add_subparsers(dest="todo", required=True)
    one = todo.add_parser("run", help="diagnose units, a line of JSON each")
    one.add_argument("--units", type=int, default=200, help="of each fault, in each cell")
    one.add_argument("--sound", type=int, help="sound units instead of --units")
    one.add_argument("--spread", action="store_true", help="--units in all cells together")
    one.add_argument("--seed-start", type=int, default=0)
    one.add_argument("--temps", type=int, nargs="+", default=[3, 5, 9])
    one.add_argument("--checks", choices=["yes", "no", "both"], default="both")
    one.add_argument("--sizes", nargs="+", default=list(SIZES_G), choices=list(SIZES_G))
    one.add_argument("--faults", nargs="+", default=[*FAULTS, *UNLISTED])
    two = todo.add_parser("tables", help="put the lines of files together")
    two.add_argument("files", type=Path, nargs="+")
    given = parser.parse_args()
    if given.todo == "tables":
        print(tables(given.files))
        return
    for unit in run(given):
        print(json.dumps(unit), flush=True)


if __name__ == "__main__":
    main()
