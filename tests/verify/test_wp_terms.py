"""WP on terms beyond the linear ones: all of each shape is proven, and no planted mistake is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from plans import INT32_MAX, INT32_MIN, integer_plan, integer_shape
from triaxcal.codegen.annotations import not_covered
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.rate import RatePlan
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify import wp
from triaxcal.verify.outcome import PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.wp_cases import SPECIFICATION, C, refuse_proof, workspace_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
ANY = (INT32_MIN, INT32_MAX)
SHAPES = {
    "gyro, cubic, 24 bits": replace(integer_shape(order=3), gyro=True),
    "gyro, constants": replace(integer_shape(order=0), gyro=True),
    "gyro, two segments, 32 bits": replace(integer_shape(order=2, segments=2, raw=ANY), gyro=True),
    "gyro, saturating": replace(integer_shape(output_shift=30, raw=ANY), gyro=True),
    "dT/dt, cubic, 24 bits": replace(integer_shape(order=3), rate=True),
    "dT/dt, two segments, 32 bits": replace(integer_shape(order=2, segments=2, raw=ANY), rate=True),
}
GYRO, SATURATING, RATE = (list(SHAPES)[i] for i in (0, 3, 4))


def plan_of(shape: Shape) -> Plan:
    """Constants that WP does not read."""
    one = [[[1] * (shape.order + 1) for _ in range(12)] for _ in range(shape.segments)]
    plan = integer_plan(shape, one)
    if shape.gyro:
        words = np.zeros((3, 3), dtype=np.int64)
        plan = replace(plan, sensitivity=words, real_sensitivity=words * 1.0, force_q=24)
    if shape.rate:
        words = np.zeros(3, dtype=np.int64)
        plan = replace(plan, rate=RatePlan(-1000, 1000, 2**21, words, words * 1.0))
    return plan


def workspace(shape: Shape, folder: Path) -> Workspace:
    """The routine of a shape."""
    return workspace_of(plan_of(shape), folder)


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    assert not not_covered(SHAPES[name])
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert {"set_temperature", "apply", "lemmas"} <= set(outcome.figures["goals"])


@pytest.mark.parametrize("name", list(SHAPES))
def test_no_lemma_is_taken_without_a_proof(name: str) -> None:
    plan = plan_of(SHAPES[name])
    texts = {
        name: wp.specification(plan, opaque=name == "opaque.h")
        for name in ("specification.h", "opaque.h")
    }
    known, opaque = (set(re.findall(r"lemma (\w+)", text)) for text in texts.values())
    parts = wp.lemmas_of(texts)
    assert parts[0].options == ("-wp-prop=@lemma",)
    assert set(parts[1].options[0].removeprefix("-wp-prop=").split(",")) == opaque - known
    assert len(opaque - known) >= 3


FAULTS = {
    "a term left out": (GYRO, C, "copy_terms", "k < 3u; k", "k < 2u; k"),
    "terms of rows and columns exchanged": (
        GYRO, C, "copy_terms", "[k] = calib->sensitivity[i][k]", "[k] = calib->sensitivity[k][i]"
    ),
    "no terms": (GYRO, C, "set_temperature", "    copy_terms(state, calib);\n", ""),
    "terms before rows": (
        GYRO, C, "set_temperature",
        "    evaluate_rows(state->row, segment, x_q31);\n",
        "    evaluate_rows(state->sensitivity, segment, x_q31);\n",
    ),
    "a force taken twice": (
        GYRO, C, "sensitivity_sum", "times(k[2], force[2])", "times(k[2], force[1])"
    ),
    "sensitivity of another axis": (
        GYRO, C, "apply_rows",
        "sensitivity_sum(state->sensitivity[1]", "sensitivity_sum(state->sensitivity[0]",
    ),
    "a sensitivity subtracted": (
        GYRO, C, "apply_rows", "sum_z += sensitivity", "sum_z -= sensitivity"
    ),
    "an offset of another axis": (
        GYRO, C, "apply_rows",
        "high_word(sum_y) + state->row[1]", "high_word(sum_y) + state->row[0]",
    ),
    "raw codes for the force": (GYRO, C, "apply", "uz, force, rate)", "uz, raw_code, rate)"),
    "a saturating sum without its term": (
        SATURATING, C, "apply", "sum_y += sensitivity_sum(state->sensitivity[1], force);", ""
    ),
    "a rate beyond its end": (
        RATE, C, "add_rate", "rate = calib->rate_max_code", "rate = calib->rate_min_code"
    ),
    "a rate that is not flagged": (
        RATE, C, "add_rate",
        "calib->rate_min_code;\n        status = TRIAX_STATUS_RATE_RANGE",
        "calib->rate_min_code;\n        status = TRIAX_STATUS_OK",
    ),
    "the offset of a rate subtracted": (RATE, C, "add_rate", "[3] += offset", "[3] -= offset"),
    "a rate added to a gain": (RATE, C, "add_rate", "[i][3] += offset", "[i][2] += offset"),
    "a rate for two axes": (
        RATE, C, "add_rate", "i < 3u; i++) {\n        const", "i < 2u; i++) {\n        const"
    ),
    "half a unit less": (RATE, C, "rate_offset_of", "(2147483648)", "(2147483647)"),
    "a rate of 1 for none": (RATE, C, "set_temperature", "temp_code, 0);", "temp_code, 1);"),
    "no rate": (
        RATE, C, "set_temperature_rate",
        "    status |= add_rate(state->row, calib, rate_code);\n", "",
    ),
    "the status of the rate alone": (
        RATE, C, "set_temperature_rate", "status |= add_rate", "status = add_rate"
    ),
    "specification: no half added": (
        RATE, SPECIFICATION, "rate_offset_of", "prod(r, w) + 2147483648", "prod(r, w)"
    ),
    "specification: every rate in range": (
        RATE, SPECIFICATION, "add_rate", "? 0 : TRIAX_STATUS_RATE_RANGE", "? 0 : 0"
    ),
    "specification: a force not counted": (
        GYRO, SPECIFICATION, "sensitivity_sum", "sum(k[0], k[1], k[2]", "sum(k[0], k[1], 0"
    ),
    "specification: twice the room": (
        GYRO, SPECIFICATION, "sensitivity_sum", "<= 536870912", "<= 1073741824"
    ),
    "specification: terms subtracted": (GYRO, SPECIFICATION, "apply_rows", "+ more", "- more"),
    "specification: a term of another axis": (
        GYRO, SPECIFICATION, "copy_terms", "(c->sensitivity[2][1], L)", "(c->sensitivity[1][1], L)"
    ),
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
