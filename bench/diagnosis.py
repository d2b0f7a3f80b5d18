"""Confusion matrices of `triaxcal diagnose` on simulated units: `python bench/diagnosis.py --help`.

The units are those of tests/diagnosis_units.py, which share nothing with the package's models. One
line is written for each fault, size, number of temperatures, with and without check dwells.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
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

SIZES_G = {"0.3-0.5 mg": (0.3e-3, 0.5e-3), "1-2 mg": (1e-3, 2e-3), "10-80 mg": (10e-3, 80e-3)}
SYMPTOMS = {"unknown", "dwells"}
"""What is right for a fault that no cause of the list is: no name, or which rows stand out."""
HARSH = {"bump_g": 0.2e-3, "noise": 1.5, "squareness": 30 * ARC}
"""What a sound unit may have: bumps in its curves, more noise than stated, a rig not square."""


def cell(fault: str, size: str, temps: int, checks: bool, units: int) -> str:
    """One line: how often the fault's cause is first, or in the answer, and what is first."""
    low, high = SIZES_G[size]
    first: Counter[str] = Counter()
    right = named = sure = 0
    started = time.process_time()
    for seed in range(units):
        size_g = float(np.exp(np.random.default_rng(seed).uniform(np.log(low), np.log(high))))
        more: dict[str, Any] = dict(HARSH) if fault == "none" else {}
        if fault == "gain":
            more["more"] = "[sensor]\nnominal_v_per_g = [0.5, 0.5, 0.5]\nnominal_tolerance = 0.05\n"
        unit, measurements, _ = simulated(fault, size_g, seed, temps, checks=checks, **more)
        answer = [s.cause for s in diagnose(unit, measurements).answer] or ["none"]
        true = {CAUSE_OF[fault]} if fault in CAUSE_OF else SYMPTOMS
        first[answer[0]] += 1
        right += answer[0] in true
        named += bool(true & {*answer})
        sure += len(set(answer)) == 1 and answer[0] not in true | SYMPTOMS | {"none"}
    each = 1e3 * (time.process_time() - started) / units
    counts = " ".join(f"{name}:{count}" for name, count in first.most_common())
    return (
        f"{temps:5d}  {'yes' if checks else 'no':6s}  {fault:12s}  {size:10s}  {units:5d}  "
        f"{100 * right / units:5.1f}  {100 * named / units:9.1f}  {100 * sure / units:5.1f}  "
        f"{each:4.0f}  {counts}"
    )


def main() -> None:
    """Write the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--sound", type=int, default=500)
    parser.add_argument("--temps", type=int, nargs="+", default=[3, 5, 9])
    parser.add_argument("--checks", choices=["yes", "no", "both"], default="both")
    parser.add_argument("--sizes", nargs="+", default=list(SIZES_G))
    parser.add_argument("--faults", nargs="+", default=[*FAULTS, *UNLISTED])
    given = parser.parse_args()
    print(
        "temps  checks  fault         size        units  first  in answer  wrong   ms  first named"
    )
    sides = {"yes": [True], "no": [False], "both": [True, False]}[given.checks]
    for temps in given.temps:
        for checks in sides:
            for fault in given.faults:
                if fault in NEEDS_CHECKS and not checks:
                    continue
                one = fault in WITHOUT_SIZE or fault == "none"
                for size in ["1-2 mg"] if one else given.sizes:
                    units = given.sound if fault == "none" else given.units
                    print(cell(fault, size, temps, checks, units), flush=True)


if __name__ == "__main__":
    main()
