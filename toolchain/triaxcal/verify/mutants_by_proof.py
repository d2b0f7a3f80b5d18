"""Mutants of the C by proof: what WP still proves is equivalent, what it does not is killed.

A contract says all that a function does. So only the goals of the functions that a mutant changes
are proven again. Each mutant is judged by the vectors as well. The two have to agree: a mutant that
the vectors kill and WP proves is a hole in the specification.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from triaxcal.codegen.annotations import not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine
from triaxcal.verify import wp
from triaxcal.verify.c_mutants import Mutant, mutants_of
from triaxcal.verify.mutation import (
    BY_COMPILER,
    BY_SANITIZER,
    EQUIVALENT,
    KILLED,
    STILLBORN,
    SURVIVED,
    Bench,
    judge_all,
)
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import ROUTINE

BY_PROOF = "not proven"
PROVEN = "proven"
REFUSED = "not accepted by Frama-C"
NO_CONTRACT = "no contract"
PROOFS = (BY_PROOF, PROVEN, REFUSED, NO_CONTRACT)

FIRST_S = 5
"""Time for a goal where the vectors kill the mutant; others have all the time of `make verify`."""


@dataclass(frozen=True)
class DoubleVerdict:
    """What became of a mutant by the vectors (`mutation.FATES`), and by proof (`PROOFS`)."""

    mutant: Mutant
    by_vectors: str
    by_proof: str

    @property
    def contradicts(self) -> bool:
        """Whether it is proven to be equivalent although something shows that it is not."""
        return self.by_proof == PROVEN and self.by_vectors in (KILLED, BY_SANITIZER)

    @property
    def open(self) -> bool:
        """Whether neither kills it, and nothing proves it: a reason on file has to say why."""
        survives = self.by_vectors in (EQUIVALENT, BY_COMPILER, SURVIVED)
        return survives and self.by_proof != PROVEN

    def __str__(self) -> str:
        return f"{self.by_vectors}, {self.by_proof}: {self.mutant}"


def both_campaigns(bench: Bench, every: int = 1) -> list[DoubleVerdict]:
    """Each `every`-th mutant of triax_comp.c by the vectors and by proof.

    Raises
    ------
    ValueError
        Where the shape has no contracts.
    MissingToolError, BrokenToolError
    """
    if reason := not_covered(bench.work.plan.shape):
        raise ValueError(f"no contracts for {reason}")
    wp.versions()
    source = (bench.work.folder / bench.work.named(ROUTINE)).read_text(encoding="utf-8")
    delivered = mutants_of(source)
    annotated = mutants_of(annotated_routine(bench.work.plan))
    if [_change(m) for m in delivered] != [_change(m) for m in annotated]:
        raise BrokenToolError("the C with annotations has other mutants than the C without")
    fates = [verdict.fate for verdict in judge_all(bench, delivered[::every], ROUTINE)]
    prove = _prover(bench)
    with ThreadPoolExecutor(2) as pool:
        proofs = pool.map(prove, zip(annotated[::every], fates, strict=True))
        return [
            DoubleVerdict(mutant, fate, proof)
            for mutant, fate, proof in zip(delivered[::every], fates, proofs, strict=True)
        ]


def _change(mutant: Mutant) -> tuple[str, str, str]:
    return mutant.function, mutant.before, mutant.after


def _prover(bench: Bench) -> Callable[[tuple[Mutant, str]], str]:
    """What judges a mutant of the annotated C, once the original is proven within `FIRST_S`."""
    folder = bench.work.folder / "wp_mutants"
    texts = wp.write_texts(bench.work, folder)
    original = wp.prepared(bench.work, folder)
    file, triad = original.file, names_of(bench.work.plan).triad
    with_contract = wp.functions_of(texts[file], original.linked)

    def proven(place: wp.Place, functions: Sequence[str], limit_s: int) -> bool | None:
        answers = [wp.is_proven(place, part, limit_s) for part in wp.parts_of(functions)]
        return None if None in answers else all(answers)

    if not proven(original, with_contract, FIRST_S):
        raise BrokenToolError(f"the original is not proven with {FIRST_S} s a goal")

    def judge(item: tuple[Mutant, str]) -> str:
        mutant, fate = item
        if fate == STILLBORN:
            return REFUSED
        changed = changed_by(mutant, texts[file], triad)
        if not changed or not set(changed) <= set(with_contract):
            return NO_CONTRACT
        with TemporaryDirectory(dir=folder) as name:
            for text in texts:
                shutil.copy(folder / text, name)
            (Path(name) / file).write_text(mutant.source, encoding="utf-8")
            place = replace(original, folder=Path(name))
            answer = proven(place, changed, FIRST_S if fate == KILLED else wp.GOAL_S)
        return REFUSED if answer is None else PROVEN if answer else BY_PROOF

    return judge


def changed_by(mutant: Mutant, text: str, triad: str) -> list[str]:
    """Functions of the C that a change lies in, or that use the macro that it lies in."""
    heads = r"^(?:static )?(?:void|u?int\d+_t) (\w+)\([^;{]*\)\n\{\n(.*?)^\}\n"
    bodies = re.findall(heads, text, re.MULTILINE | re.DOTALL)
    found = [name for name, _ in bodies if name == mutant.function]
    if not found:
        used = {mutant.function}
        for macro, body in re.findall(r"^#define (\w+) (.*)", text, re.MULTILINE):
            if used & set(re.findall(r"\w+", body)):
                used.add(macro)
        found = [name for name, body in bodies if used & set(re.findall(r"\w+", body))]
    return [name.removeprefix(f"{triad}_") for name in found]
