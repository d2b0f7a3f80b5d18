"""What WP takes without a proof, or makes no goal of, is an error and not a proof."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from plans import COVERING, random_plan
from triaxcal.codegen.annotations import loader_not_covered, not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.wp_texts import (
    contracts_of,
    overlooked,
    statements_of,
    unexpected_warning,
    without_goal,
)
from verify import test_wp_codes, test_wp_saturating, test_wp_terms
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.test_wp_codes import workspace
from verify.test_wp_loader import SHAPE
from verify.test_wp_terms import plan_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
PLANS = {
    name: plan_of(shape)
    for module in (test_wp_codes, test_wp_terms, test_wp_saturating)
    for name, shape in module.SHAPES.items()
} | {
    name: random_plan(random.Random(1), shape)
    for name, shape in COVERING.items()
    if not not_covered(shape)
}


def doubts(text: str = "", old: str = "", new: str = "") -> list[str]:
    """What is overlooked of a shape whose loader has contracts, with a text changed."""
    plan = plan_of(SHAPE)
    texts = {
        "C": annotated_routine(plan),
        "definitions": specification(plan, opaque=False),
        "opaque": specification(plan, opaque=True),
    }
    if text:
        assert old in texts[text]
        texts[text] = texts[text].replace(old, new, 1)
    return overlooked(*_arguments(texts), loader=True)


def _arguments(texts: dict[str, str]) -> tuple[str, str, str, str]:
    return texts["C"], "triax", texts["definitions"], texts["opaque"]


@pytest.mark.parametrize("name", list(PLANS))
def test_nothing_is_overlooked(name: str) -> None:
    plan = PLANS[name]
    names = names_of(plan)
    text = annotated_routine(plan)
    definitions, opaque = (specification(plan, opaque=flag) for flag in (False, True))
    loader = not loader_not_covered(plan.shape)
    assert overlooked(text, names.triad, definitions, opaque, loader=loader) == []
    with_contract = [f for f, contract in contracts_of(text, names.triad).items() if contract]
    assert with_contract == wp.functions_of(text, names.linked)
    for read in (definitions, opaque):
        lemmas = [n for n, s in statements_of(read).items() if s.startswith("lemma")]
        assert lemmas == wp._LEMMA.findall(read)


FAULTS = {
    "a lemma that is admitted": (
        "definitions",
        "lemma halved:",
        "admit lemma halved:",
        "admit takes what follows",
    ),
    "an axiom": ("opaque", "lemma whole_row", "axiom whole_row", "axiom takes what follows"),
    "a step that is admitted": (
        "C",
        "/*@ assert ux ==",
        "/*@ admit ux ==",
        "admit takes what follows",
    ),
    "a comment that no form leaves out": (
        "C",
        "    return p;",
        "    //@ assert p == 0;\n    return p;",
        "//@ takes",
    ),
    "a function without a contract": (
        "C",
        "/*@ assigns \\nothing; ensures \\result == mag",
        "/* \\result == mag",
        "no contract of magnitude",
    ),
    "a contract of nothing": (
        "C",
        "static int32_t clamp_raw(",
        "/* Here. */\nstatic int32_t clamp_raw(",
        "no contract of clamp_raw",
    ),
    "a structure compared": (
        "C",
        "same_calib{Post,Pre}(calib)",
        "*calib == \\old(*calib)",
        "compares structures",
    ),
    "a structure compared with one before": (
        "C",
        "same_calib{Post,Pre}(calib)",
        "0 == 0 && \\at(*calib, Pre) == *calib",
        "compares structures",
    ),
    "a lemma of other words": (
        "opaque",
        "mag(polynomial(c, x)) <= bound(c)",
        "mag(polynomial(c, x)) < bound(c)",
        "polynomial_bounded has two meanings",
    ),
    "a definition of other words": (
        "opaque",
        "2 * mag(d) <",
        "2 * mag(d) <=",
        "row_bounded has two meanings",
    ),
    "what is defined nowhere": (
        "opaque",
        "predicate below_12",
        "predicate never(integer n);\n  predicate below_12",
        "never has two meanings",
    ),
    "a function of other parameters": (
        "opaque",
        "prod(integer a, integer b);",
        "prod(integer b, integer a);",
        "prod has two meanings",
    ),
}
"""Text, what it has, by what it is replaced, and what is said of it."""


@pytest.mark.parametrize("name", list(FAULTS))
def test_what_would_be_taken_without_a_proof_is_seen(name: str) -> None:
    *fault, said = FAULTS[name]
    found = doubts(*fault)
    assert any(said in doubt for doubt in found), found


def test_a_function_of_any_type_is_proven() -> None:
    text = annotated_routine(plan_of(SHAPE)).replace("static int32_t rounded(", "size_t rounded(")
    assert "rounded" in wp.functions_of(text, "triax_01234567")
    assert contracts_of(text, "triax")["rounded"]


def test_too_few_goals_are_seen() -> None:
    contracts = {"f": "/*@ ensures a; ensures b; */", "g": "/*@ ensures c; */", "h": ""}
    goals = ["f_ensures", "f_ensures_2", "g_ensures", "g_assigns", "f_call_g_requires"]
    assert without_goal(goals, contracts) == []
    assert without_goal(goals[1:], contracts) == ["f"]
    assert without_goal(goals[:2], contracts) == ["g"]


def test_a_warning_that_is_not_known_is_seen() -> None:
    known = (
        "[wp] a.c:1: Warning: \n  Memory model hypotheses for function 'image_fits':\n  /*@\n"
        "[wp] a.c:2: Warning: Failed smoke-test\n"
    )
    other = "[wp] a.c:3: Warning: Missing RTE guards\n"
    of_others = (
        "[wp:pedantic-assigns] a.c:4: Warning: \n  No 'assigns' specification for function 'f'.\n"
    )
    assert unexpected_warning(known, of_lemmas=False) == ""
    assert unexpected_warning(known + other, of_lemmas=True) == "Missing RTE guards"
    assert unexpected_warning(known + of_others, of_lemmas=True) == ""
    assert unexpected_warning(known + of_others, of_lemmas=False).startswith("No 'assigns'")


@PROVERS
def test_a_file_that_is_not_the_routine_is_not_proven(tmp_path: Path) -> None:
    work = workspace(SHAPE, tmp_path / "work")
    file = work.folder / "triax_comp.c"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("uy = raw_code[1]", "uy = raw_code[0]"), encoding="utf-8")
    outcome = wp.check(work)
    assert outcome.result == FAILED
    assert (
        outcome.finding == "triax_comp.c is not the routine of this shape: nothing is proven of it"
    )


@PROVERS
def test_a_lemma_that_is_admitted_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = workspace(SHAPE, tmp_path / "work")
    original = wp.specification
    monkeypatch.setattr(
        wp,
        "specification",
        lambda *args, **options: original(*args, **options).replace("lemma w", "admit lemma w", 1),
    )
    with pytest.raises(BrokenToolError, match="contracts: admit takes what follows"):
        wp.check(work)
