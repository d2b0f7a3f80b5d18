"""Mutants by proof: killed, equivalent, without a contract; and what contradicts the vectors."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine
from triaxcal.verify import mutants_by_proof, wp
from triaxcal.verify.c_mutants import Mutant, mutants_of
from triaxcal.verify.mutants_by_proof import (
    BY_PROOF,
    NO_CONTRACT,
    PROVEN,
    DoubleVerdict,
    both_campaigns,
)
from triaxcal.verify.mutation import EQUIVALENT, KILLED, SURVIVED, Bench
from triaxcal.verify.shapes import Subject
from triaxcal.verify.tools import run_until
from triaxcal.verify.workspace import Workspace
from verify.conftest import needs

COVERED = "direct-two-segments"
PROVERS = needs("frama-c", "why3", "cvc4", "z3")


@pytest.fixture
def bench(subjects: dict[str, Subject], tmp_path: Path) -> Bench:
    made = subjects[COVERED]
    return Bench(Workspace.create(tmp_path, made.files, made.plan, made.bound), COVERED)


def only(monkeypatch: pytest.MonkeyPatch, *changes: tuple[str, str]) -> None:
    """The campaign makes these mutants only."""

    def chosen(source: str) -> list[Mutant]:
        found = [m for m in mutants_of(source) if (m.before, m.after) in changes]
        assert len(found) == len(changes)
        return found

    monkeypatch.setattr(mutants_by_proof, "mutants_of", chosen)


def test_a_mutant_changes_its_function_or_those_that_use_its_macro(
    subjects: dict[str, Subject],
) -> None:
    plan = subjects[COVERED].plan
    text = annotated_routine(plan)
    places = {m.function: m for m in mutants_of(text)}
    changed = {name: mutants_by_proof.changed_by(m, text, "triax") for name, m in places.items()}
    assert changed["triax_apply"] == ["apply"]
    assert changed["ROW_LIMIT"] == ["segment_fits"]
    # It is a part of SEGMENTS_AT.
    assert "read_segment" in changed["HEADER_WORDS"]
    assert "read_segment" not in changed["ROW_LIMIT"]
    assert all(changed.values())


def test_only_comments_that_begin_with_a_contract_count(subjects: dict[str, Subject]) -> None:
    plan = subjects[COVERED].plan
    found = wp.functions_of(annotated_routine(plan), names_of(plan).linked)
    assert {"s32", "apply", "set_temperature"} <= set(found)
    text = "/* A comment. */\nstatic int32_t f(int32_t a)\n{\n}\n"
    assert wp.functions_of(text, "triax_01234567") == []
    assert wp.functions_of(f"/*@ ensures 2 * a; */\n{text[17:]}", "triax_01234567") == ["f"]


def test_a_contract_that_no_run_proves_is_an_error() -> None:
    with pytest.raises(ValueError, match="unheard_of"):
        wp.parts_of(["apply", "unheard_of"])


def test_a_run_ends_with_all_that_it_started(tmp_path: Path) -> None:
    script = "sleep 30 & echo $!; echo stop; wait"
    seen: list[str] = []

    def stop(line: str) -> bool:
        seen.append(line.strip())
        return line == "stop\n"

    assert run_until(stop, ["sh", "-c", script], tmp_path) is None
    state = Path(f"/proc/{seen[0]}/stat")
    assert not state.exists() or state.read_text().split(") ")[1][0] in "ZX"
    answer = run_until(lambda _: False, ["sh", "-c", "echo a; exit 3"], tmp_path)
    assert answer is not None
    assert (answer.code, answer.text) == (3, "a\n")


@pytest.mark.parametrize(
    ("fates", "contradicts", "is_open"),
    [
        ((KILLED, BY_PROOF), False, False),
        ((KILLED, PROVEN), True, False),
        ((KILLED, NO_CONTRACT), False, False),
        ((SURVIVED, PROVEN), False, False),
        ((SURVIVED, BY_PROOF), False, True),
        ((EQUIVALENT, BY_PROOF), False, True),
        ((EQUIVALENT, NO_CONTRACT), False, True),
    ],
)
def test_verdicts(fates: tuple[str, str], contradicts: bool, is_open: bool) -> None:
    verdict = DoubleVerdict(Mutant("f", 1, "a", "b", ""), *fates)
    assert (verdict.contradicts, verdict.open) == (contradicts, is_open)


def test_a_shape_without_contracts_is_refused(
    subjects: dict[str, Subject], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = subjects["inverse"]
    work = Workspace.create(tmp_path, made.files, made.plan, made.bound)
    monkeypatch.setattr(mutants_by_proof, "not_covered", lambda _: "some part")
    with pytest.raises(ValueError, match="some part"):
        both_campaigns(Bench(work, "inverse"))


MAGNITUDE = "return (value < 0) ? -(int64_t)value : (int64_t)value;"
HIGH_WORD = "return (value < 0) ? (-1 - (int32_t)((-1 - value) >> 32)) : (int32_t)(value >> 32);"


@PROVERS
@pytest.mark.slow
def test_proof_and_vectors_agree(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    only(
        monkeypatch,
        (MAGNITUDE, MAGNITUDE.replace("value < 0", "value <= 0")),
        (MAGNITUDE, MAGNITUDE.replace("-(int64_t)value", "(int64_t)value")),
        # Equal under gcc; C99 leaves >> of -1 to the compiler, and so WP does not prove it.
        (HIGH_WORD, HIGH_WORD.replace("value < 0", "value <= 0")),
    )
    verdicts = {(v.mutant.function, v.by_vectors, v.by_proof) for v in both_campaigns(bench)}
    assert verdicts == {
        ("magnitude", EQUIVALENT, PROVEN),
        ("magnitude", KILLED, BY_PROOF),
        ("high_word", EQUIVALENT, BY_PROOF),
    }


@PROVERS
@pytest.mark.slow
def test_a_hole_in_a_contract_is_seen(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    text = annotated_routine(bench.work.plan)
    contract = r"ensures \result == mag(value);"
    assert text.count(contract) == 1
    weak = text.replace(contract, r"ensures mag(\result) == mag(value);")
    for module in (mutants_by_proof, wp):
        monkeypatch.setattr(module, "annotated_routine", lambda _: weak)
    only(monkeypatch, (MAGNITUDE, MAGNITUDE.replace("-(int64_t)value", "(int64_t)value")))
    (verdict,) = both_campaigns(bench)
    assert verdict.contradicts


@PROVERS
@pytest.mark.slow
def test_no_mutant_contradicts_and_none_is_open_without_a_reason(bench: Bench) -> None:
    verdicts = both_campaigns(bench, int(os.environ.get("EVERY") or 20))
    killed = [v for v in verdicts if (v.by_vectors, v.by_proof) == (KILLED, BY_PROOF)]
    assert len(killed) > len(verdicts) / 10
    assert not [v for v in verdicts if v.contradicts]
    assert not [v for v in verdicts if v.open and v.by_vectors != EQUIVALENT]
