"""WP proves the C of a covered shape, and proves no planted mistake; other shapes are not done."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from plans import integer_shape, random_plan
from triaxcal.base.tools import MissingToolError
from triaxcal.codegen.annotations import not_covered, with_contracts, without_annotations
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, render_routine, specification
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED, Outcome
from triaxcal.verify.shapes import ALL_SHAPES, Subject
from triaxcal.verify.tools import run
from triaxcal.verify.workspace import Workspace
from triaxcal.verify.wp_texts import contracts_of
from verify.conftest import Planter, needs
from verify.wp_cases import workspace_of

COVERED = "direct-two-segments"
PROVERS = needs("frama-c", "why3", "cvc4", "z3")


@pytest.fixture(autouse=True)
def nothing_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test takes a proof of an earlier run for its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.parametrize("shape", list(ALL_SHAPES))
def test_annotations_are_comments_only(subjects: dict[str, Subject], shape: str) -> None:
    plan = subjects[shape].plan
    full = annotated_routine(plan)
    delivered = next(t for n, t in render_routine(plan).items() if n.endswith("comp.c"))
    assert "/*@" in full
    assert "loop invariant" not in delivered
    assert without_annotations(full) == without_annotations(delivered)
    assert "@*/" not in without_annotations(full)
    assert ("/*@" in delivered) == (not not_covered(plan.shape))


def test_steps_and_contracts_are_told_apart() -> None:
    contract = "/*@ requires a;\n    ensures b; */\n"
    text = contract + "int f(void)\n{\n    /*@ assert c;\n      */\n    x();\n}\n"
    assert with_contracts(text) == contract + "int f(void)\n{\n    x();\n}\n"
    assert without_annotations(text) == "int f(void)\n{\n    x();\n}\n"


@pytest.mark.parametrize("shape", list(ALL_SHAPES))
def test_no_contract_orders_a_shift(subjects: dict[str, Subject], shape: str) -> None:
    """Frama-C 25 takes 0 < v >> n for 0 < v; equality with a quotient is sound."""
    text = annotated_routine(subjects[shape].plan)
    proven = re.findall(
        r"^(/\*@.*?\*/)\n(?!/\*)(\w[^\n]*\n)?(.*?^\}\n)", text, re.MULTILINE | re.DOTALL
    )
    shifting = [contract for contract, _, body in proven if ">>" in body]
    assert len(shifting) >= 1
    for contract in shifting:
        ensured = re.findall(r"(?:ensures|assigns) ([^;]*);", contract)
        assert ensured[0] == r"\nothing"
        assert re.fullmatch(r"\\result == [^<>]*", "\n".join(ensured[1:])), contract


def test_opaque_specification_defines_no_product(subjects: dict[str, Subject]) -> None:
    plan = subjects[COVERED].plan
    known, opaque = (specification(plan, opaque=flag) for flag in (False, True))
    assert "prod(integer a, integer b) = a * b;" in known
    assert "prod(integer a, integer b);" in opaque
    lemmas = set(re.findall(r"lemma (\w+)", known))
    assert {"within", "value_bounded", "floors_nest"} <= lemmas
    # What is taken without a definition is proven with it, except what follows from other lemmas.
    others = set(re.findall(r"lemma (\w+)", opaque)) - lemmas
    assert {"row_bounded_of", "words_make_calib"} <= others
    parts = wp.lemmas_of({"specification.h": known, "opaque.h": opaque})
    assert [part.specification for part in parts] == ["specification.h", "opaque.h"]
    assert set(parts[1].options[0].removeprefix("-wp-prop=").split(",")) == others


@pytest.mark.parametrize("shape", [name for name in ALL_SHAPES if name != COVERED])
def test_a_shape_without_contracts_is_not_done(
    plant: Planter, subjects: dict[str, Subject], shape: str
) -> None:
    if subjects[shape].plan.shape.gyro or not not_covered(subjects[shape].plan.shape):
        pytest.skip("covered, or a gyro: the planter writes an accelerometer's files")
    outcome = wp.check(plant(shape))
    assert outcome.result == NOT_DONE
    assert outcome.finding.startswith("not done for ")


@pytest.mark.parametrize(
    ("failing", "result"),
    [
        ((32, "dead_code", 3), PASSED),
        ((32, "dead_code", 4), FAILED),
        ((31, "dead_code", 1), FAILED),
        ((32, "default_requires", 1), FAILED),
    ],
)
def test_what_cannot_saturate_is_never_reached(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, failing: tuple[int, str, int], result: str
) -> None:
    shift, kind, count = failing
    plan = random_plan(random.Random(1), integer_shape(output_shift=shift))
    goals = {
        f"apply{wp.SMOKE}{kind}_s{i}": {"function": "apply", "prover": "x" * (i >= count)}
        for i in range(6)
    }
    monkeypatch.setattr(wp, "versions", dict)
    monkeypatch.setattr(wp, "_prove", lambda *_: goals)
    outcome = wp.check(workspace_of(plan, tmp_path / "work"))
    assert outcome.result == result
    assert f"{6 - count} of 6 smoke tests" in outcome.finding
    assert ("nothing needs to be saturated" in outcome.finding) == (result == PASSED)


@PROVERS
def test_another_version_of_a_prover_is_not_done(
    plant: Planter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(wp.KNOWN, "cvc4", "1.9")
    with pytest.raises(MissingToolError, match=r"cvc4 1\.9 is known, found: .*1\.8"):
        wp.check(plant(COVERED))


@pytest.mark.parametrize("text", ["", "{}", '{"a": {"prover": "z3"', '{"a": "proven"}', "[]"])
def test_a_file_of_goals_that_is_not_whole_proves_nothing(tmp_path: Path, text: str) -> None:
    file = tmp_path / "goals.json"
    assert wp._kept(file) == {}
    file.write_text(text)
    assert wp._kept(file) == {}


def test_a_program_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingToolError, match=r"^no-such-objdump not found$"):
        run([str(tmp_path / "no-such-objdump"), "-d"], tmp_path)


@PROVERS
@pytest.mark.slow
def test_every_goal_is_proven_and_known_the_next_time(
    plant: Planter, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = plant(COVERED)
    outcome = wp.check(work)
    assert outcome.result == PASSED, outcome
    goals = outcome.figures["goals"]
    assert outcome.figures["smoke_tests"] > len(goals)
    assert {"set_temperature", "apply", "lemmas", "evaluate_rows"} <= set(goals)
    monkeypatch.setattr(wp, "_prove", lambda *_: pytest.fail("the same texts are proven again"))
    assert wp.check(work) == outcome


FAULTS = {
    "high_word of a negative": ("high_word", "(-1 - value) >> 32", "(-2 - value) >> 32"),
    "high_word shifts less": ("high_word", "(int32_t)(value >> 32)", "(int32_t)(value >> 33)"),
    "the spare shift": ("asr32", ": (value >> 3)", ": (value >> 2)"),
    "a product without its sign": ("times", "(int64_t)a * b", "-(int64_t)a * b"),
    "a step that subtracts": ("horner_step", "return c + high", "return c - high"),
    "a coefficient taken twice": ("evaluate", "horner_step(c[0]", "horner_step(c[1]"),
    "the row of another axis": ("evaluate_column", "coefficient[4u + j]", "coefficient[3u + j]"),
    "one column too few": (
        "evaluate_rows", "j < 4u; j++) {\n        /*@ assert same",
        "j < 3u; j++) {\n        /*@ assert same",
    ),
    "x from the wrong side": ("x_q31_of", "(code - segment", "(-code - segment"),
    "a clamp at the other end": (
        "set_temperature", "code = calib->temp_max_code", "code = calib->temp_min_code",
    ),
    "a segment too late": ("set_temperature", "(code >= calib", "(code > calib"),
    "a status of the other end": ("set_temperature", "_TEMP_LOW;", "_TEMP_HIGH;"),
    "another axis's row": ("apply_rows", "apply_row(state->row[1]", "apply_row(state->row[0]"),
    "an offset subtracted": ("rounded", "high_word(sum) + offset", "high_word(sum) - offset"),
    "x and y exchanged": ("apply", "uy = raw_code[1]", "uy = raw_code[0]"),
    "a gain of another code": ("apply_row", "times(row[1], uy)", "times(row[1], ux)"),
}  # fmt: skip
"""Function whose goals fail, and the mistake."""


def judged(
    work: Workspace, monkeypatch: pytest.MonkeyPatch, function: str, old: str, new: str
) -> Outcome:
    """The outcome of one function alone, with a text of the annotated C replaced."""
    text = annotated_routine(work.plan)
    assert text.count(old) == 1, old
    present = wp.functions_of(text, names_of(work.plan).linked)
    name = [n for n in present if re.sub(r"_\d+$", "", n) == function]
    monkeypatch.setattr(wp, "annotated_routine", lambda _: text.replace(old, new))
    monkeypatch.setattr(wp, "functions_of", lambda *_: name)
    monkeypatch.setattr(wp, "GOAL_S", 5)
    monkeypatch.setattr(wp, "lemmas_of", lambda _: [])
    return wp.check(work)


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    plant: Planter, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    outcome = judged(plant(COVERED), monkeypatch, *FAULTS[name])
    assert outcome.result == FAILED
    assert "not proven: " in outcome.finding


@PROVERS
@pytest.mark.slow
def test_what_is_proven_from_a_contradiction_fails(
    plant: Planter, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = "requires step_bound(c, mag(p)) <= INT32_MAX;"
    new = "requires step_bound(c, mag(p)) < 0; ensures 1 == 2;"
    outcome = judged(plant(COVERED), monkeypatch, "horner_step", old, new)
    goals, proven = outcome.figures["goals"]["horner_step"], outcome.finding.split(" ")[0]
    assert int(proven) == goals > 3
    assert outcome.result == FAILED
    assert "not proven: horner_step_wp_smoke_default_requires" in outcome.finding


@PROVERS
@pytest.mark.slow
def test_each_contract_with_opposite_conditions_fails(plant: Planter) -> None:
    work = plant(COVERED)
    folder = work.folder / "wp"
    text = wp.write_texts(work, folder)[work.named("triax_comp.c")]
    place = wp.prepared(work, folder)
    contracts = contracts_of(text, names_of(work.plan).triad)
    conditions = {n: re.search(r"requires (?:\w+: )?([^;]*);", c) for n, c in contracts.items()}
    assert len([name for name, found in conditions.items() if found]) >= 20
    for name, found in conditions.items():
        if not found:
            continue
        contract = contracts[name]
        opposite = contract.replace("requires", f"requires !({found[1]});\n    requires", 1)
        assert text.count(contract) == 1, name
        (folder / place.file).write_text(text.replace(contract, opposite), encoding="utf-8")
        (part,) = wp.parts_of([name])
        goals = wp.goals_of(place, part)
        failed = [goal for goal, result in goals.items() if not result["prover"]]
        assert any(f"{name}_wp_smoke_default_requires" in goal for goal in failed), name
