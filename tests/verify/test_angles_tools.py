"""The checks of the angles pass, and complain of planted mistakes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from triaxcal.fixedpoint.proof import prove
from triaxcal.targets.shapes import ANGLES, Case, shipped_cases
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE
from triaxcal.verify import angles, cppcheck
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.workspace import ANGLES as ANGLES_C
from triaxcal.verify.workspace import ROUTINE, Workspace
from verify.conftest import UNITS, needs

CHECKS = {key: check for key, _, check in angles.CHECKS}
Plant = Callable[..., Workspace]


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    return {c.name: c for c in shipped_cases(UNITS) if c.angles is not None}


@pytest.fixture
def plant(cases: dict[str, Case], tmp_path: Path) -> Plant:
    def make(pair: str, old: str = "", new: str = "") -> Workspace:
        case = cases[ANGLES[pair]]
        text = case.files["triax_angles.c"]
        assert old in text
        files = {**case.files, "triax_angles.c": text.replace(old, new, 1)}
        content = {name: t.encode() for name, t in files.items()} | {"triax_calib.bin": case.image}
        return Workspace.create(tmp_path, content, case.plan, prove(case.plan), case.angles)

    return make


@needs("frama-c", "cppcheck", "gcc", "clang")
@pytest.mark.parametrize(
    "pair", [pytest.param(ZENITH_TOOL_FACE, marks=pytest.mark.slow), PITCH_ROLL]
)
def test_every_check_passes(pair: str, plant: Plant) -> None:
    work = plant(pair)
    sources = [work.named(name) for name in (ROUTINE, ANGLES_C)]
    found = cppcheck.find_in(work.folder, sources, [work.plan])
    ours = [f for f in found if f.file.startswith("triax_angles")]
    assert cppcheck.judge(ours).result == PASSED
    for key, check in CHECKS.items():
        if key != "angles_cost":  # counted by tests/targets
            assert check(work).result == PASSED, key


@needs("frama-c")
def test_eva_sees_a_shift_that_is_too_far(plant: Plant) -> None:
    outcome = CHECKS["angles_eva"](plant(PITCH_ROLL, "((left - common) & 31u)", "(left + common)"))
    assert outcome.result == FAILED


@needs("gcc")
def test_the_sanitizers_compare_with_python(plant: Plant) -> None:
    outcome = CHECKS["angles_gcc_sanitizers"](plant(PITCH_ROLL, "83443u", "83442u"))
    assert outcome.result == FAILED
    assert "differ" in str(outcome.details)


@needs("cppcheck")
def test_cppcheck_looks_at_the_angles(plant: Plant) -> None:
    work = plant(ZENITH_TOOL_FACE, "(word ^ sign) - sign", "word ^ sign - sign")
    found = cppcheck.find_in(work.folder, [work.named(ANGLES_C)], [work.plan])
    assert any(f.file == "triax_angles.c" and f.rule == "12.1" for f in found)
