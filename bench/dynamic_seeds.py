"""Full-length recordings of many simulated units against their truth: the base model, seed by seed.

A seed's line is written when it is done, and a file that has it is continued: the campaign may be
stopped at any time. Half a minute of CPU a seed.

    python bench/dynamic_seeds.py FILE [aviation|mems] [first] [seeds]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from dynamic_judge import judge
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import three_axes


def main() -> None:
    target = Path(sys.argv[1])
    grade = sys.argv[2] if len(sys.argv) > 2 else "aviation"
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    count = int(sys.argv[4]) if len(sys.argv) > 4 else 20
    rows = [json.loads(line) for line in target.read_text().splitlines()] if target.exists() else []
    done = {row["seed"] for row in rows if row["grade"] == grade}
    for seed in sorted(set(range(first, first + count)) - done):
        verdict = judge(draw_truth(GRADES[grade], seed), three_axes(40.0), 200.0, seed)
        row = {"grade": grade, "seed": seed, "z": verdict.z.tolist(), "nees": verdict.nees}
        rows.append(row)
        with target.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(f"seed {seed}: largest {np.abs(verdict.z).max():.2f} sd", flush=True)
    mine = [row for row in rows if row["grade"] == grade]
    z = np.array([row["z"] for row in mine])
    print(
        f"{len(mine)} seeds: weighted squares {sum(row['nees'] for row in mine):.0f} of {z.size}, "
        f"{np.count_nonzero(np.abs(z) > 3)} beyond 3 sd, largest {np.abs(z).max():.2f}"
    )


if __name__ == "__main__":
    main()
