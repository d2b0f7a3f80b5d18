"""The delivered C of simulated IMUs against exact physics at held-out temperatures, unit by unit.

python bench/imu_over_temperature.py [first seed] [seeds]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from compiled_judge import delivered, judged_c
from thermal_cases import HELD_OUT, PROGRAMMES, truth_of
from triaxcal.base.errors import RefusedError

COVERAGE = 1.96
COLUMNS = ("force, micro-g", "rate at rest, deg/h", "rate in turns, deg/h")


def main() -> None:
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 11
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 8
    for name, programme in PROGRAMMES.items():
        rows = []
        for seed in range(first, first + count):
            truth = truth_of(seed)
            with tempfile.TemporaryDirectory() as folder:
                try:
                    ran = delivered(Path(folder), truth, programme(truth, seed))
                except RefusedError as refused:
                    print(f"{name}, seed {seed}: {str(refused).replace(folder, '')}", flush=True)
                    continue
                rows += [_row(judged_c(ran, degc)) for degc in HELD_OUT[name]]
        found = np.array(rows)
        print(f"{name}, {len(found)} temperatures")
        for k, column in enumerate(COLUMNS):
            square, stated, inside, largest = found[:, k].T
            print(
                f"  {column}: rms {np.sqrt(square.mean()):.3g}, stated sd "
                f"{np.sqrt(stated.mean()):.3g}, largest {largest.max():.3g}, "
                f"{100 * inside.mean():.1f} % inside of 95 %",
                flush=True,
            )


def _row(found) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Mean square of error and stated deviation, part inside of 95 %, largest; of each column."""
    deg_per_h = np.degrees(1.0) * 3600
    rest, turn = found.resting, ~found.resting
    made = []
    for error, sd, least, unit in (
        (found.accel, found.accel_sd, found.accel_least, 1e6),
        (found.rate[rest], found.rate_sd[rest], found.rate_least, deg_per_h),
        (found.rate[turn], found.rate_sd[turn], found.rate_least, deg_per_h),
    ):
        whole = np.hypot(sd, least / np.sqrt(3))  # a code's half is an even distribution
        inside = (np.abs(error) < COVERAGE * whole).mean()
        made.append(
            (
                (error**2).mean() * unit**2,
                (sd**2).mean() * unit**2,
                inside,
                np.abs(error).max() * unit,
            )
        )
    return np.array(made)


if __name__ == "__main__":
    main()
