"""Generated C of fixed plans and of both pairs of angles, byte for byte."""

from __future__ import annotations

import difflib
from dataclasses import replace
from pathlib import Path

import pytest

from builds import PROVENANCE
from plans import GOLDEN, SENSOR
from triaxcal.codegen.angles import render_angles
from triaxcal.codegen.constants import render_constants
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import render_routine
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE, AnglesChoice
from triaxcal.unit.arithmetic import LIMBS, THUMB1, THUMB2

FOLDER = Path(__file__).parent / "golden"
ANGLES_GOLDEN = {
    f"angles-{pair}": AnglesPlan(AnglesChoice(pair), 24) for pair in (ZENITH_TOOL_FACE, PITCH_ROLL)
}
ALL = (*GOLDEN, *ANGLES_GOLDEN)
REMEDY = "if the change is meant: make golden (pytest --update-golden), read git diff, commit"


def rendered(name: str) -> dict[str, str]:
    if name in ANGLES_GOLDEN:
        return render_angles(ANGLES_GOLDEN[name], names_of(GOLDEN["direct-checked"]))
    plan = GOLDEN[name]
    forms = {
        file: text
        for form in (LIMBS, THUMB1, THUMB2)
        for file, text in render_routine(replace(plan, arithmetic=form)).items()
    }
    return {
        **forms,
        **render_routine(plan),
        **render_constants(plan, SENSOR, PROVENANCE),
    }


def compare_or_update(found: str, golden: Path, *, update: bool) -> None:
    """Fail with a diff when `golden` does not hold `found`; with `update`, write it."""
    if update:
        golden.parent.mkdir(parents=True, exist_ok=True)
        golden.write_bytes(found.encode())
        return
    expected = golden.read_bytes().decode() if golden.exists() else ""
    if found == expected:
        return
    difference = difflib.unified_diff(
        expected.splitlines(),
        found.splitlines(),
        f"{golden.name} (golden)",
        "now",
        lineterm="",
        n=1,
    )
    pytest.fail("\n".join([*list(difference)[:60], REMEDY]), pytrace=False)


@pytest.mark.parametrize(("name", "file"), [(n, f) for n in ALL for f in rendered(n)])
def test_generated_c_is_as_it_was(name: str, file: str, request: pytest.FixtureRequest) -> None:
    update = bool(request.config.getoption("--update-golden"))
    compare_or_update(rendered(name)[file], FOLDER / name / file, update=update)


def test_every_golden_file_belongs_to_a_plan() -> None:
    kept = {str(p.relative_to(FOLDER)) for p in FOLDER.rglob("*") if p.is_file()}
    assert kept == {f"{name}/{file}" for name in ALL for file in rendered(name)}


@pytest.mark.parametrize("name", ALL)
def test_rendering_twice_gives_the_same_bytes(name: str) -> None:
    assert rendered(name) == rendered(name)


def test_a_difference_is_shown_with_its_remedy(tmp_path: Path) -> None:
    golden = tmp_path / "triax_comp.c"
    compare_or_update("one\ntwo\nthree\n", golden, update=True)
    compare_or_update("one\ntwo\nthree\n", golden, update=False)
    with pytest.raises(pytest.fail.Exception) as failure:
        compare_or_update("one\n2\nthree\n", golden, update=False)
    assert "-two\n+2" in str(failure.value)
    assert "make golden" in str(failure.value)
    with pytest.raises(pytest.fail.Exception, match="make golden"):
        compare_or_update("new\n", tmp_path / "missing.c", update=False)


@pytest.mark.parametrize("name", ALL)
def test_golden_files_name_no_clock_host_or_path(name: str) -> None:
    for text in rendered(name).values():
        assert str(Path.cwd()) not in text
        assert "/home/" not in text
        assert not any(word in text for word in ("20:", ":20", "Jan ", "UTC", "localhost"))


@pytest.mark.parametrize("name", ALL)
def test_templates_leave_no_trace(name: str) -> None:
    for file, text in rendered(name).items():
        assert "{{" not in text
        assert "{%" not in text
        assert text.endswith("\n")
        assert not text.endswith("\n\n")
        assert "\t" not in text
        trailing = [i for i, line in enumerate(text.split("\n"), 1) if line != line.rstrip()]
        assert trailing == [], f"{file}, lines {trailing} end in spaces"
        assert "\n\n\n" not in text, f"{file} has two empty lines together"
