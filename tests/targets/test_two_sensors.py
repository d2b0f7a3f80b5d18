"""Two sensors of different shapes, each with a prefix of its own, in one firmware."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import install_advice, missing_tools
from triaxcal.codegen.shim import write_shim
from triaxcal.model.terms import NO_TERMS
from triaxcal.targets.build import Toolset, _support, compiled, emulate, link_command, run
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.matrix import compare
from triaxcal.targets.shapes import Case, made_case
from triaxcal.targets.vectors import case_header, expected_lines
from triaxcal.unit.arithmetic import PORTABLE, THUMB2

UNITS = Path(__file__).parents[2] / "units"
FIRMWARE = shipped("firmware_ref")
MAIN = """int left_main(void); int right_main(void); int main(void);
int main(void) { return left_main() | right_main(); }
"""


def objects_of(toolset: Toolset, case: Case, folder: Path) -> list[str]:
    """The C of a case and its test program, whose main has the prefix in its name."""
    prefix = case.plan.prefix
    folder.mkdir()
    for name, text in case.files.items():
        (folder / name).write_text(text)
    (folder / "target_case.h").write_text(case_header(case))
    own = (folder / name for name in (*case.sources, case.selftest))
    sources = [*own, FIRMWARE / "target" / "test_main.c"]
    renamed = replace(toolset, defines=(f"-Dmain={prefix}_main",))
    include = [folder, *write_shim(folder / "names", prefix), FIRMWARE]
    return compiled(renamed, sources, include, folder / "made")


@pytest.mark.parametrize("arithmetic", [PORTABLE, THUMB2])
def test_two_shapes_give_the_digests_of_each_alone(arithmetic: str, tmp_path: Path) -> None:
    core = next(c for c in CORES if c.name == "Cortex-M3")
    toolset = Toolset(core, "gcc", "-O2", arithmetic)
    missing = missing_tools(core.tools("gcc"))
    if missing:
        pytest.skip(f"{', '.join(missing)} not found: {install_advice(missing)}")
    cases = [
        made_case(UNITS / unit, prefix, "", lambda u, p=prefix: replace(u, prefix=p), NO_TERMS)
        for unit, prefix in (("AT-SIM", "left"), ("AT-CHERNIAK", "right"))
    ]
    cases = [case.in_form(arithmetic) for case in cases]
    assert cases[0].names.shape != cases[1].names.shape
    objects = [o for c in cases for o in objects_of(toolset, c, tmp_path / c.plan.prefix)]
    (tmp_path / "both.c").write_text(MAIN)
    common = [FIRMWARE / "triax_ref.c", FIRMWARE / "triax_ref_image.c", tmp_path / "both.c"]
    objects += compiled(toolset, [*common, *_support(core)], [FIRMWARE], tmp_path / "common")
    program = tmp_path / "program.elf"
    run([*link_command(core), *objects, "-lgcc", "-o", str(program)])
    lines = emulate(core, program).splitlines()
    expected = [expected_lines(case) for case in cases]  # what each prints alone
    assert expected[0]["generated"] != expected[1]["generated"]
    for k, wanted in enumerate(expected):
        half = lines[k * len(wanted) : (k + 1) * len(wanted)]
        assert compare("\n".join(half), wanted) == ""
    assert len(lines) == sum(map(len, expected))
