"""WP on further shapes: all of each is proven, and no planted mistake is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from triaxcal.codegen.annotations import not_covered
from triaxcal.codegen.render import annotated_routine
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.terms import NO_TERMS
from triaxcal.targets.shapes import made_case
from triaxcal.unit.description import UnitDescription
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import UNITS, needs
from verify.test_wp import nothing_known
from verify.wp_cases import SPECIFICATION, C, plant

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")


def _saturating(unit: UnitDescription) -> UnitDescription:
    return replace(unit, output_q=29)


SHAPES = {
    "saturating": ("AT-CHERNIAK", _saturating),
}
"""Unit, and what is changed in its description."""


@pytest.fixture
def work(request: pytest.FixtureRequest, tmp_path: Path) -> Workspace:
    """Delivered files of a shape."""
    unit, change = SHAPES[request.param]
    case = made_case(UNITS / unit, request.param, "", change, NO_TERMS)
    files = {name: text.encode() for name, text in case.files.items()}
    return Workspace.create(tmp_path / "work", files, case.plan, prove(case.plan))


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("work", list(SHAPES), indirect=True)
def test_every_goal_is_proven(work: Workspace) -> None:
    assert not not_covered(work.plan.shape)
    outcome = wp.check(work)
    assert outcome.result == PASSED, outcome
    assert {"set_temperature", "apply", "lemmas"} <= set(outcome.figures["goals"])


FAULTS = {
    "saturation at the other end": (
        "saturating", C, "saturate32",
        "> (int64_t)INT32_MAX) {\n        result = (int64_t)INT32_MAX",
        "> (int64_t)INT32_MAX) {\n        result = (int64_t)INT32_MIN",
    ),
    "a shift of one bit less": ("saturating", C, "asr64_30", ": (value >> 30)", ": (value >> 29)"),
    "a negative sum shifted to zero": ("saturating", C, "asr64_30", "(-1 - ((-1", "(-((-1"),
    "a negative sum floored one lower": (
        "saturating", C, "asr64_30", "((-1 - value) >> 30)", "((-2 - value) >> 30)"
    ),
    "a flag of large results only": (
        "saturating", C, "apply", "accel[1] != sum_y", "accel[1] < sum_y"
    ),
    "an offset of another axis": (
        "saturating", C, "apply",
        "sum_z += ((int64_t)state->row[2][3]", "sum_z += ((int64_t)state->row[1][3]",
    ),
    "the rounding of a unit more": (
        "saturating", C, "apply",
        "row[0][3] * INT64_C(4294967296)) + INT64_C(536870912)",
        "row[0][3] * INT64_C(4294967296)) + INT64_C(536870913)",
    ),
    "specification: no rounding": (
        "saturating", SPECIFICATION, "apply", "4294967296 + 536870912", "4294967296"
    ),
    "specification: z needs no flag": (
        "saturating", SPECIFICATION, "apply", "INT32_MIN <= z <= INT32_MAX", "z == z"
    ),
    "specification: clamped to 31 bits": (
        "saturating", SPECIFICATION, "apply",
        "z), INT32_MIN, INT32_MAX)", "z), INT32_MIN / 2, INT32_MAX)",
    ),
}  # fmt: skip
"""Shape, text that has the mistake, function whose goals fail, and the mistake."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "name"), [(FAULTS[name][0], name) for name in FAULTS], indirect=["work"]
)
def test_a_planted_mistake_is_not_proven(
    work: Workspace, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    _, text, function, old, new = FAULTS[name]
    assert old in annotated_routine(work.plan) + wp.specification(work.plan, opaque=False)

    plant(monkeypatch, text, old, new)
    monkeypatch.setattr(wp, "GOAL_S", 5)
    monkeypatch.setattr(wp, "functions_of", lambda *_: [function])
    monkeypatch.setattr(wp, "lemmas_of", lambda _: [])
    outcome = wp.check(work)
    assert outcome.result == FAILED
    assert "not proven: " in outcome.finding
