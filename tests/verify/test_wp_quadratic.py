"""WP on quadratic terms of results that cannot saturate: proven, and no planted mistake is."""

from __future__ import annotations

from pathlib import Path

import pytest

from plans import integer_shape
from triaxcal.codegen.annotations import not_covered
from triaxcal.verify import wp
from triaxcal.verify.outcome import PASSED
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.test_wp_terms import workspace
from verify.wp_cases import SPECIFICATION, C, refuse_proof

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
SHAPES = {
    "cubic, 24 bits": integer_shape(order=3, quadratic=True),
    "constants": integer_shape(order=0, quadratic=True),
    "two segments, 24 bits": integer_shape(order=2, segments=2, quadratic=True),
}
CUBIC, SEGMENTED = (list(SHAPES)[i] for i in (0, 2))


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    assert not not_covered(SHAPES[name])
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    expected = {"products_of", "quadratic_sum", "copy_terms", "set_temperature", "apply", "lemmas"}
    assert expected <= set(outcome.figures["goals"])


FAULTS = {
    "xy for xz": (CUBIC, C, "products_of", "times(x, z)", "times(x, y)"),
    "a low word for a high one": (
        CUBIC, C, "products_of",
        "product[1] = high_word(times(y, y))", "product[1] = (int32_t)times(y, y)",
    ),
    "a product without its offset": (
        CUBIC, C, "products_of", "high_word(sum_z) + state->row[2][3]", "high_word(sum_z)"
    ),
    "an offset of another axis for a product": (
        CUBIC, C, "products_of",
        "high_word(sum_y) + state->row[1]", "high_word(sum_y) + state->row[0]",
    ),
    "a product left out": (CUBIC, C, "quadratic_sum", " + times(q[5], product[5])", ""),
    "a word of another product": (CUBIC, C, "quadratic_sum", "times(q[3], ", "times(q[2], "),
    "a term left out": (CUBIC, C, "copy_terms", "k < 6u; k", "k < 5u; k"),
    "the segment of a lower code": (
        SEGMENTED, C, "set_temperature",
        "code >= calib->segment[i].first_code", "code > calib->segment[i].first_code",
    ),
    "no terms in the state": (
        SEGMENTED, C, "set_temperature", "    copy_terms(state, calib);\n", ""
    ),
    "terms of another axis": (
        CUBIC, C, "apply_rows",
        "quadratic_sum(state->quadratic[1]", "quadratic_sum(state->quadratic[0]",
    ),
    "half an output LSB less": (CUBIC, C, "apply_rows", "row[2][3]) + 4)", "row[2][3]) + 3)"),
    "specification: the segment before": (
        SEGMENTED, SPECIFICATION, "set_temperature",
        "code >= c->segment[n - 1].first_code", "code > c->segment[n - 1].first_code",
    ),
    "specification: xy for xz": (
        CUBIC, SPECIFICATION, "apply_rows", "product_of(x, z)", "product_of(x, y)"
    ),
    "specification: a product one more": (
        CUBIC, SPECIFICATION, "products_of",
        "= floor_32(prod(a, b));", "= floor_32(prod(a, b)) + 1;",
    ),
    "specification: a word of another product": (
        CUBIC, SPECIFICATION, "quadratic_sum", "prod(q[1], yy)", "prod(q[1], xx)"
    ),
    "specification: one word not counted": (
        CUBIC, SPECIFICATION, "quadratic_sum", "mag(k[4]) + mag(k[5])", "mag(k[4])"
    ),
    "specification: no rounding": (CUBIC, SPECIFICATION, "apply_rows", " + 17179869184;", ";"),
}  # fmt: skip
"""Shape, text that has the mistake, function whose goals fail, and the mistake."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    shape, *mistake = FAULTS[name]
    refuse_proof(workspace(SHAPES[shape], tmp_path / "work"), monkeypatch, tuple(mistake))
