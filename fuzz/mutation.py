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
from collections.abc import Sequence
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
from triaxcal.verify.shapes import SHAPES, subject
from triaxcal.verify.workspace import Workspace

HERE = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaigns and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="only each n-th mutant")
    parser.add_argument("--shape", choices=list(SHAPES), action="append")
    parser.add_argument("--units", type=Path, default=HERE.parent / "units")
    given = parser.parse_args(arguments)
    verdicts: list[Verdict] = []
    for shape in given.shape or SHAPES:
        verdicts += _shape(shape, given.units, given.every)
    survivors = [v.mutant for v in verdicts if v.fate == SURVIVED]
    for mutant in survivors:
        print(f"survived: {mutant}")
    stale = _stale(verdicts) if given.every == 1 and not given.shape else []
    for entry in stale:
        print(f"{EQUIVALENTS.name}: no mutant is this one: {entry}")
    print(f"{len(verdicts)} mutants, {len(survivors)} survived")
    return int(bool(survivors or stale))


def _shape(shape: str, units: Path, every: int) -> list[Verdict]:
    made = subject(shape, units)
    verdicts: list[Verdict] = []
    with tempfile.TemporaryDirectory(prefix="triaxcal-mutants-") as folder:
        bench = Bench(Workspace.create(Path(folder), made.files, made.plan, made.bound))
        for file, campaign in CAMPAIGNS.items():
            found = campaign(bench, every)
            counts = Counter(v.fate for v in found)
            told = ", ".join(f"{counts[fate]} {fate}" for fate in FATES if counts[fate])
            print(f"{shape}, {file}: {told}", flush=True)
            verdicts += found
    return verdicts


def _stale(verdicts: Sequence[Verdict]) -> list[str]:
    equivalent = [v.mutant for v in verdicts if v.fate == EQUIVALENT]
    return [
        f"{e.function}: {e.before}"
        for e in read_equivalents()
        if not any(e.covers(mutant) for mutant in equivalent)
    ]


if __name__ == "__main__":
    sys.exit(main())
