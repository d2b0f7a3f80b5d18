"""Mutation testing of the generated C, the constants and the image, on a few shapes.

python fuzz/mutation.py [--every 1] [--shape NAME] [--units units]

Exit code 1 when a mutant survives that is not on file as equivalent, or when an entry of that file
covers none (told only when every mutant of every shape was made).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from triaxcal.verify.mutation import (
    CAMPAIGNS,
    EQUIVALENT,
    EQUIVALENTS,
    FATES,
    SURVIVED,
    Bench,
    Verdict,
    read_equivalents,
)
from triaxcal.verify.shapes import ALL_SHAPES, subject
from triaxcal.verify.workspace import Workspace

HERE = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaigns and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="only each n-th mutant")
    parser.add_argument("--shape", choices=list(ALL_SHAPES), action="append")
    parser.add_argument("--units", type=Path, default=HERE.parent / "units")
    given = parser.parse_args(arguments)
    by_shape = {s: _shape(s, given.units, given.every) for s in given.shape or ALL_SHAPES}
    verdicts = [v for found in by_shape.values() for v in found]
    survivors = [v.mutant for v in verdicts if v.fate == SURVIVED]
    stale = _stale(by_shape) if given.every == 1 and not given.shape else []
    for entry in stale:
        print(f"{EQUIVALENTS.name}: no mutant is this one: {entry}")
    print(f"{len(verdicts)} mutants, {len(survivors)} survived")
    return int(bool(survivors or stale))


def _shape(shape: str, units: Path, every: int) -> list[Verdict]:
    made = subject(shape, units)
    verdicts: list[Verdict] = []
    with tempfile.TemporaryDirectory(prefix="triaxcal-mutants-") as folder:
        bench = Bench(Workspace.create(Path(folder), made.files, made.plan, made.bound), shape)
        for file, campaign in CAMPAIGNS.items():
            found = campaign(bench, every)
            counts = Counter(v.fate for v in found)
            told = ", ".join(f"{counts[fate]} {fate}" for fate in FATES if counts[fate])
            print(f"{shape}, {file}: {told}", flush=True)
            for verdict in found:
                if verdict.fate == SURVIVED:
                    print(f"  survived: {verdict.mutant}", flush=True)
            verdicts += found
    return verdicts


def _stale(by_shape: Mapping[str, Sequence[Verdict]]) -> list[str]:
    return [
        f"{e.function}: {e.before}"
        for e in read_equivalents()
        if not any(
            v.fate == EQUIVALENT and e.covers(v.mutant, shape)
            for shape, verdicts in by_shape.items()
            for v in verdicts
        )
    ]


if __name__ == "__main__":
    sys.exit(main())
