"""WP on raw codes of fewer than 32 bits, orders and segments: proven, and no planted mistake is."""

from __future__ import annotations

from pathlib import Path

import pytest

from plans import COVERING, integer_plan, integer_shape
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.wp_cases import SPECIFICATION, C, plant, workspace_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
SHAPES = {
    "cubic, 24 bits": integer_shape(order=3),
    "order 1, a range that is no power of two": integer_shape(raw=(-8_000_000, 8_200_000)),
    "order 2, codes without sign, three segments": integer_shape(
        order=2, segments=3, raw=(0, 2**12 - 1)
    ),
    "constants": integer_shape(order=0),
    "order 4": integer_shape(order=4),
    "order 5, 32 bits, two segments": integer_shape(order=5, segments=2, raw=(-(2**31), 2**31 - 1)),
    "order 9, eight segments": COVERING["direct-order-9-eight-segments"],
    "sums of high words": integer_shape(order=0, high_words=True, raw=(-8_000_000, 8_200_000)),
}
CUBIC, ODD, CONSTANT, FIFTH, HIGH = (list(SHAPES)[i] for i in (0, 1, 3, 5, 7))


def workspace(shape: Shape, folder: Path) -> Workspace:
    """The routine of a shape, with constants that WP does not read."""
    one = [[[1] * (shape.order + 1) for _ in range(12)] for _ in range(shape.segments)]
    return workspace_of(integer_plan(shape, one), folder)


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert {"set_temperature", "apply", "lemmas"} <= set(outcome.figures["goals"])


@PROVERS
def test_test_of_the_range_is_proven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["above_min", "beyond_range", "out_of_range", "clamp_raw"]
    monkeypatch.setattr(wp, "functions_of", lambda *_: names)
    monkeypatch.setattr(wp, "lemmas_of", lambda _: [])
    outcome = wp.check(workspace(SHAPES[CUBIC], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert set(outcome.figures["goals"]) == set(names)


FAULTS = {
    "one less above the minimum": (
        CUBIC,
        C,
        "above_min",
        "INT64_C(4294967296)",
        "INT64_C(4294967295)",
    ),
    "the minimum itself below it": (
        CUBIC,
        C,
        "above_min",
        "(code < TRIAX_RAW",
        "(code <= TRIAX_RAW",
    ),
    "a range of one bit less": (CUBIC, C, "beyond_range", ">> 24u", ">> 23u"),
    "z not looked at": (CUBIC, C, "out_of_range", "| above_min(uz)", "| above_min(uy)"),
    "and for or": (CUBIC, C, "out_of_range", "(ux) | above", "(ux) & above"),
    "a clamp to one less": (
        CUBIC,
        C,
        "clamp_raw",
        "result = TRIAX_RAW_MAX",
        "result = TRIAX_RAW_MAX - 1",
    ),
    "y clamped to x": (CUBIC, C, "apply", "uy = clamp_raw(uy)", "uy = clamp_raw(ux)"),
    "half the left shift": (CUBIC, C, "apply", "uz *= 256", "uz *= 128"),
    "a range test of one code less": (
        ODD,
        C,
        "apply",
        "above_min(uy) > 16200000u",
        "above_min(uy) > 16199999u",
    ),
    "y tested twice": (ODD, C, "apply", "above_min(uz) > 1", "above_min(uy) > 1"),
    "a column left out": (CONSTANT, C, "copy_rows", "j < 4u; j", "j < 3u; j"),
    "a row of another axis": (CONSTANT, C, "copy_rows", "(4u * i) + j", "(3u * i) + j"),
    "a coefficient left out": (FIFTH, C, "evaluate", "p = c[5]", "p = c[4]"),
    "a coefficient of another order": (FIFTH, C, "evaluate", "c[4], x_q31, p", "c[3], x_q31, p"),
    "a column of another axis": (
        FIFTH,
        C,
        "evaluate_column",
        "evaluate(segment->coefficient[8u + j]",
        "evaluate(segment->coefficient[4u + j]",
    ),
    "a high word of another product": (
        HIGH,
        C,
        "apply_row",
        "times(row[1], uy)",
        "times(row[1], ux)",
    ),
    "an offset subtracted from high words": (HIGH, C, "apply_row", "z + row[3]", "z - row[3]"),
    "the whole product for its high word": (
        HIGH,
        C,
        "apply_row",
        "z = high_word(times(row[2], uz))",
        "z = (int32_t)times(row[2], uz)",
    ),
    "specification: a floor of another product": (
        HIGH,
        SPECIFICATION,
        "apply_row",
        "floor_32(prod(r[1], y))",
        "floor_32(prod(r[1], x))",
    ),
    "specification: high words without the offset": (
        HIGH,
        SPECIFICATION,
        "apply_row",
        " + r[3]);",
        ");",
    ),
    "specification: a step left out": (
        FIFTH,
        SPECIFICATION,
        "evaluate",
        "step(c4, x, value_5(c5, x))",
        "value_5(c5, x)",
    ),
    "specification: a step without its limit": (
        FIFTH,
        SPECIFICATION,
        "evaluate",
        "bound_4(c4, c5) <= 2147483647 && ",
        "",
    ),
    "specification: the maximum flagged": (
        CUBIC,
        SPECIFICATION,
        "out_of_range",
        "y <= TRIAX_RAW_MAX",
        "y < TRIAX_RAW_MAX",
    ),
    "specification: half the shift": (
        CUBIC,
        SPECIFICATION,
        "apply",
        "TRIAX_RAW_MAX) * 256",
        "TRIAX_RAW_MAX) * 128",
    ),
    "specification: no wrap": (CUBIC, SPECIFICATION, "above_min", "? 4294967296 : 0", "? 0 : 0"),
    "specification: a shorter range": (
        CUBIC,
        SPECIFICATION,
        "out_of_range",
        "< 16777216 <==> in_range",
        "< 8388608 <==> in_range",
    ),
    "specification: constants of another axis": (
        CONSTANT,
        SPECIFICATION,
        "copy_rows",
        "coefficient[f + j]",
        "coefficient[f]",
    ),
}
"""Shape, text that has the mistake, function whose goals or lemmas fail, and the mistake."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    shape, text, function, old, new = FAULTS[name]
    work = workspace(SHAPES[shape], tmp_path / "work")
    original = {C: annotated_routine, SPECIFICATION: specification}[text]
    assert old in str(original(work.plan, **({} if text == C else {"opaque": False})))

    plant(monkeypatch, text, old, new)
    monkeypatch.setattr(wp, "functions_of", lambda *_: [function])
    monkeypatch.setattr(wp, "GOAL_S", 5)
    # What out_of_range takes from a lemma is right or wrong where the lemma is proven.
    if not (text == SPECIFICATION and function == "out_of_range"):
        monkeypatch.setattr(wp, "lemmas_of", lambda _: [])
    outcome = wp.check(work)
    assert outcome.result == FAILED
    assert "not proven: " in outcome.finding
