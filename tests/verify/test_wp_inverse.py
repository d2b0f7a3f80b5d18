"""WP on the form that inverts K(T): all of each shape is proven, and no planted mistake is."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from plans import COVERING, INT32_MAX, INT32_MIN, integer_shape, random_plan
from triaxcal.codegen.annotations import not_covered
from triaxcal.fixedpoint.shape import Shape
from triaxcal.model.methods.method import INVERSE
from triaxcal.verify import wp
from triaxcal.verify.outcome import PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import Planter, needs
from verify.test_wp import nothing_known
from verify.wp_cases import SPECIFICATION, C, refuse_proof, workspace_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
SHAPE = COVERING["inverse-32-bit-three-segments"]
SHAPES = {
    "three segments, 32 bits": SHAPE,
    "saturating, 32 bits": integer_shape(
        form=INVERSE, order=3, output_shift=32, raw=(INT32_MIN, INT32_MAX), shifts=(30, 29, 60, 30)
    ),
    "constants, saturating": COVERING["inverse-saturating-order-0"],
}


def workspace(shape: Shape, folder: Path) -> Workspace:
    """The routine of a shape."""
    return workspace_of(random_plan(random.Random(1), shape), folder)


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    assert not not_covered(SHAPES[name])
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert {"set_temperature", "invert", "apply", "lemmas"} <= set(outcome.figures["goals"])


@PROVERS
@pytest.mark.slow
def test_every_goal_of_a_unit_is_proven(plant: Planter) -> None:
    outcome = wp.check(plant("inverse"))
    assert outcome.result == PASSED, outcome
    assert "not the loader" not in outcome.finding


INNER = "; j++) {\n        /*@ loop invariant 0 <= i <= 3;"
"""Between a loop over columns and the one over rows inside it."""
FAULTS = {
    "a permanent for a cofactor": (C, "cofactor", "d) - times(b, c)", "d) + times(b, c)"),
    "a cofactor of the same row": (
        C, "cofactor_at", "j2 = (j + 2u) % 3u", "j2 = (j + 1u) % 3u"
    ),
    "the adjugate transposed": (
        C, "adjugate_of", "cofactor_at(row, i, j)", "cofactor_at(row, j, i)"
    ),
    "the adjugate of two columns": (C, "adjugate_of", f"j < 3u{INNER}", f"j < 2u{INNER}"),
    "a row times another row": (
        C, "determinant_of", "times(row[j], adjugate[j][0])", "times(row[j], adjugate[j][1])"
    ),
    "a reciprocal without its sign": (C, "reciprocal", "? -quotient", "? quotient"),
    "a determinant that may be 0": (C, "reciprocal", "divisor <", "divisor + 1 <"),
    "a gain rounded down": (
        C, "element", "inverse) + INT64_C(1073741824)", "inverse) + INT64_C(0)"
    ),
    "half an output LSB less": (C, "offset_of", "asr64_30(product", "1 + asr64_30(product"),
    "one word of U0 for all": (C, "invert_row", "times(row[j], u0[j])", "times(row[j], u0[0])"),
    "a negative gain takes room away": (
        C, "invert_row", "row_sum += magnitude(row[j])", "row_sum += row[j]"
    ),
    "a row at the limit": (C, "invert", ">= ROW_LIMIT", "> ROW_LIMIT"),
    "y of U0 for x": (C, "invert", "u0[3] = {row[0][3]", "u0[3] = {row[1][3]"),
    "a row that does not fit, kept": (C, "invert_at", "clear_rows(row);", ";"),
    "offsets not cleared":(C, "clear_rows", f"j < 4u{INNER}", f"j < 3u{INNER}"),
    "the status of the temperature lost": (
        C, "set_temperature", "status |= TRIAX_STATUS_BAD", "status = TRIAX_STATUS_BAD"
    ),
    "specification: a product twice": (SPECIFICATION, "cofactor", "- prod(b, c)", "- prod(a, c)"),
    "specification: K transposed": (
        SPECIFICATION, "cofactor_at", "cofactor(r[(j + 1) % 3][(i + 1) % 3]",
        "cofactor(r[(i + 1) % 3][(j + 1) % 3]",
    ),
    "specification: offsets counted once": (
        SPECIFICATION, "invert", "mag(c) + 2 * mag(d)", "mag(c) + mag(d)"
    ),
    "specification: another determinant": (
        SPECIFICATION, "invert", "expanded(k00, k01, k02,", "expanded(k00, k02, k01,"
    ),
    "specification: not all is cleared": (
        SPECIFICATION, "clear_rows", "r[2][3] == 0;", "r[2][3] == 1;"
    ),
    "specification: functions of another axis": (
        SPECIFICATION, "invert_at", "coefficient[8][0], x)", "coefficient[9][0], x)"
    ),
}  # fmt: skip
"""Text that has the mistake, function whose goals fail, and the mistake."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    refuse_proof(workspace(SHAPE, tmp_path / "work"), monkeypatch, FAULTS[name])
