"""Mutation testing of the generated C, the constants and the image, on a few shapes.

python fuzz/mutation.py [--every 1] [--shape NAME] [--units units] [--selftest | --proof]

With --selftest: how many mutants of triax_comp.c the self-test of the unit finds alone, and which
it does not. No survivor is a failure then.

With --proof: mutants of triax_comp.c by the vectors and by Frama-C WP, for shapes with contracts.
Exit code 1 when a mutant is proven that the vectors kill, or one survives both without a reason on
file.

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

from triaxcal.codegen.annotations import not_covered
from triaxcal.codegen.names import Names
from triaxcal.verify.mutants_by_proof import PROOFS, both_campaigns
from triaxcal.verify.mutation import (
    CAMPAIGNS,
    EQUIVALENT,
    EQUIVALENTS,
    FATES,
    KILLED,
    STILLBORN,
    SURVIVED,
    Bench,
    Verdict,
    c_campaign,
    read_equivalents,
)
from triaxcal.verify.mutation_selftest import SelftestBench
from triaxcal.verify.shapes import ALL_SHAPES, subject
from triaxcal.verify.workspace import Workspace

HERE = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaigns and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="only each n-th mutant")
    parser.add_argument("--shape", choices=list(ALL_SHAPES), action="append")
    parser.add_argument("--units", type=Path, default=HERE.parent / "units")
    parser.add_argument("--selftest", action="store_true", help="by the self-test alone")
    parser.add_argument("--proof", action="store_true", help="by the vectors and by proof")
    given = parser.parse_args(arguments)
    if given.proof:
        agree = [_proof(s, given.units, given.every) for s in given.shape or ALL_SHAPES]
        return int(not all(agree))
    if given.selftest:
        for shape in given.shape or ALL_SHAPES:
            _selftest(shape, given.units, given.every)
        return 0
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


def _proof(shape: str, units: Path, every: int) -> bool:
    """Whether the vectors and WP agree, and nothing survives both without a reason on file."""
    made = subject(shape, units)
    if reason := not_covered(made.plan.shape):
        print(f"{shape}: no contracts for {reason}", flush=True)
        return True
    with tempfile.TemporaryDirectory(prefix="triaxcal-mutants-") as folder:
        work = Workspace.create(Path(folder), made.files, made.plan, made.bound)
        found = both_campaigns(Bench(work, shape), every)
    counts = Counter((v.by_vectors, v.by_proof) for v in found)
    for fate in FATES:
        told = ", ".join(f"{counts[fate, p]} {p}" for p in PROOFS if counts[fate, p])
        if told:
            print(f"{shape}, {fate}: {told}", flush=True)
    for verdict in found:
        if verdict.contradicts or verdict.open:
            print(f"  {verdict}", flush=True)
    return not any(v.contradicts or (v.open and v.by_vectors != EQUIVALENT) for v in found)


def _selftest(shape: str, units: Path, every: int) -> None:
    made = subject(shape, units)
    with tempfile.TemporaryDirectory(prefix="triaxcal-mutants-") as folder:
        work = Workspace.create(Path(folder), made.files, made.plan, made.bound)
        found = c_campaign(SelftestBench(work, shape), every)
    counts = Counter(v.fate for v in found)
    judged = len(found) - sum(counts[fate] for fate in (EQUIVALENT, STILLBORN))
    told = ", ".join(f"{counts[fate]} {fate}" for fate in FATES if counts[fate])
    print(f"{shape}, self-test: {told}: {counts[KILLED] / judged:.1%} of {judged}", flush=True)
    for verdict in found:
        if verdict.fate not in (KILLED, EQUIVALENT, STILLBORN):
            print(f"  {verdict.fate}: {verdict.mutant}", flush=True)


def _stale(by_shape: Mapping[str, Sequence[Verdict]]) -> list[str]:
    """Entries that cover no mutant of any shape; each shape has names of its own in its C."""
    used: set[int] = set()
    for shape, verdicts in by_shape.items():
        found = [v.mutant for v in verdicts if v.fate == EQUIVALENT]
        entries = read_equivalents(Names("triax_gyro" if shape == "gyro" else "triax", "accel", ""))
        used |= {i for i, e in enumerate(entries) if any(e.covers(m, shape) for m in found)}
    entries = read_equivalents(Names("triax", "accel", ""))
    return [f"{e.function}: {e.before}" for i, e in enumerate(entries) if i not in used]


if __name__ == "__main__":
    sys.exit(main())
