"""WP on saturating results of raw codes of fewer than 32 bits: proven, planted mistakes are not."""

from __future__ import annotations

from dataclasses import replace
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
    "24 bits": integer_shape(output_shift=30),
    "a range that is no power of two": integer_shape(output_shift=32, raw=(-8_000_000, 8_200_000)),
    "gyro, 24 bits": replace(integer_shape(output_shift=30), gyro=True),
}
NARROW, ODD, GYRO = SHAPES


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    assert not not_covered(SHAPES[name])
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert {"with_saturated", "apply", "lemmas"} <= set(outcome.figures["goals"])


FAULTS = {
    "no bit added": (NARROW, C, "with_saturated", "status | TRIAX", "status & TRIAX"),
    "the status of the raw codes lost": (NARROW, C, "with_saturated", "status | TRIAX", "TRIAX"),
    "x is not flagged": (NARROW, C, "apply", "        status = with_saturated(status);\n", ""),
    "a flag of small results only": (NARROW, C, "apply", "accel[1] != sum_y", "accel[1] > sum_y"),
    "a clamped code counted as saturated": (
        NARROW, C, "apply", "status = TRIAX_STATUS_RAW_RANGE", "status = TRIAX_STATUS_SATURATED"
    ),
    "z saturated as y": (NARROW, C, "apply", "saturate32(sum_z)", "saturate32(sum_y)"),
    "z clamped as y": (NARROW, C, "apply", "uz = clamp_raw(uz)", "uz = clamp_raw(uy)"),
    "a range test of one code more": (ODD, C, "apply", "(uy) > 16200000u", "(uy) > 16200001u"),
    "a gyro's sum without its term": (
        GYRO, C, "apply", "    sum_x += sensitivity_sum(state->sensitivity[0], force);\n", ""
    ),
    "specification: the flag of the raw codes": (
        NARROW, SPECIFICATION, "apply",
        "? 0 : TRIAX_STATUS_SATURATED", "? 0 : TRIAX_STATUS_RAW_RANGE",
    ),
    "specification: results of any size": (
        NARROW, SPECIFICATION, "apply",
        "clamp(exact(r, x, y, z), INT32_MIN, INT32_MAX)", "exact(r, x, y, z)",
    ),
    "specification: the minimum is flagged": (
        NARROW, SPECIFICATION, "apply", "INT32_MIN <= y <= INT32_MAX", "INT32_MIN < y <= INT32_MAX"
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
