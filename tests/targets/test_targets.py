"""The target room: vectors, digests, verdicts. What needs a cross compiler is skipped by name."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from plans import (
    COVERING,
    SENSOR,
    integer_plan,
    random_matrix_rows,
    random_quadratic,
    random_rows,
    with_quadratic,
)
from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.base.tools import TOOLS, install_advice, missing_tools
from triaxcal.codegen.constants import Provenance, render_constants
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.selftest import render_selftest
from triaxcal.report.summary import HORNER_STEP_ON_M3
from triaxcal.targets import bench_table, counting, matrix
from triaxcal.targets.bench import Subject, _write_subject, cost_of
from triaxcal.targets.build import TargetError, Toolset, build, compiled, emulate
from triaxcal.targets.cores import registry as cores
from triaxcal.targets.cores.core import COMPILERS, VECTORS
from triaxcal.targets.counting import build_plugin, measure
from triaxcal.targets.matrix import (
    FAILED,
    NOT_DONE,
    PASSED,
    Build,
    compare,
    run_builds,
)
from triaxcal.targets.shapes import (
    CUBIC,
    CUBIC_LEFT,
    GYRO,
    ORDER_4,
    RATE_ALONE,
    Case,
    shipped_cases,
    unit_case,
)
from triaxcal.targets.table import counts, matrix_table
from triaxcal.targets.vectors import draw, expected_lines, raw_boundaries, vectors
from triaxcal.unit.arithmetic import LIMBS, PORTABLE, THUMB1, THUMB2

ROOT = Path(__file__).parents[2]
FIRMWARE = shipped("firmware_ref")
CASES = shipped_cases(ROOT / "units")
M3 = next(core for core in cores.CORES if core.name == "Cortex-M3")
AVR = next(core for core in cores.CORES if core.name == "AVR")


def case_named(name: str) -> Case:
    return next(c for c in CASES if c.name == name)


def need(*tools: str) -> None:
    missing = missing_tools(tools)
    if missing:
        pytest.skip(f"{', '.join(missing)} not found: {install_advice(missing)}")


def run_on_host(case: Case, folder: Path, arithmetic: str = PORTABLE) -> str:
    """test_main.c as a program of this machine."""
    case = case.in_form(arithmetic)
    way = Toolset(M3, "gcc", "-O1", arithmetic)
    source = matrix._write_cases([Build(case, way)], folder)[case.name, arithmetic]
    target = FIRMWARE / "target"
    program = folder / "program"
    files = [
        *(source / name for name in (*case.sources, case.selftest)),
        FIRMWARE / "triax_ref.c",
        FIRMWARE / "triax_ref_image.c",
    ]
    command = ["gcc", "-std=c99", "-O1", "-DTARGET_HOSTED", f"-DCASE_VECTORS={VECTORS}u"]
    command += [f"-I{d}" for d in (source, FIRMWARE, target)]
    command += map(str, [*files, target / "test_main.c", target / "target_io.c"])
    subprocess.run([*command, "-o", str(program)], check=True)
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout


def test_draw_is_the_finaliser_of_murmurhash3() -> None:
    # By hand for counter 1, in Python's own integers.
    x = 0x9E3779B9
    x = (x ^ (x >> 16)) * 0x85EBCA6B % 2**32
    x = (x ^ (x >> 13)) * 0xC2B2AE35 % 2**32
    assert draw(np.array([1], np.uint32))[0] == x ^ (x >> 16)


@pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)
def test_vectors_meet_every_boundary_and_stay_where_they_should(case: Case) -> None:
    temp, raw = vectors(case.plan)
    shape = case.plan.shape
    assert temp.shape == (VECTORS,)
    in_range = np.arange(VECTORS) % 4 < 2
    assert (raw[in_range] >= shape.raw_min).all()
    assert (raw[in_range] <= shape.raw_max).all()
    assert (temp[in_range] >= case.plan.temp_min_code).all()
    assert (temp[in_range] <= case.plan.temp_max_code).all()
    for axis in range(3):
        assert set(raw_boundaries(case.plan)) <= set(raw[3::4, axis].tolist())


QUICK = (CUBIC, "inverse", "fine thermometer")


@pytest.mark.parametrize("arithmetic", [PORTABLE, LIMBS])
@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=() if c.name in QUICK else pytest.mark.slow, id=c.name) for c in CASES],
)
def test_host_prints_what_python_expects(case: Case, arithmetic: str, tmp_path: Path) -> None:
    assert compare(run_on_host(case, tmp_path, arithmetic), expected_lines(case)) == ""


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("rounded(sum,", "rounded(sum + 4294967296,", "generated"),
        ("status = TRIAX_STATUS_RAW_RANGE;", ";", "generated"),
        ("if (crc32(image, TRIAX_IMAGE_SIZE", "if (0u && crc32(image, TRIAX_IMAGE_SIZE", "refused"),
    ],
)
def test_a_fault_in_the_generated_c_is_seen(old: str, new: str, line: str, tmp_path: Path) -> None:
    case = case_named(CUBIC)
    text = case.files["triax_comp.c"]
    assert old in text
    broken = replace(case, files={**case.files, "triax_comp.c": text.replace(old, new, 1)})
    printed = dict(text.split() for text in run_on_host(broken, tmp_path).splitlines())
    expected = {name: f"{value:08x}" for name, value in expected_lines(case).items()}
    # The self-test of the unit sees it as well.
    assert {"selftest", line} <= {name for name in expected if printed[name] != expected[name]}


def test_a_fault_in_the_limb_form_is_seen(tmp_path: Path) -> None:
    case = case_named("fine thermometer").in_form(LIMBS)
    text = case.files["triax_comp_limbs.c"]
    old = "(int32_t)(low >> 16)"
    assert old in text
    broken = replace(case, files={**case.files, "triax_comp_limbs.c": text.replace(old, "0", 1)})
    assert compare(run_on_host(broken, tmp_path, LIMBS), expected_lines(case)).startswith("printed")


def test_compare_names_the_first_difference() -> None:
    expected = {"generated": 1, "load": 0}
    assert compare("generated 00000001\nload 00000000\n", expected) == ""
    assert compare("generated 00000002\nload 00000000\n", expected) == (
        "printed 'generated 00000002', expected 'generated 00000001'"
    )
    assert compare("generated 00000001\n", expected) == "printed 1 lines, expected 2"


def test_missing_tool_is_named_and_not_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _tool: None)
    outcomes = run_builds([Build(case_named(CUBIC), Toolset(M3, "clang", "-O2"))])
    assert outcomes[0].status == NOT_DONE
    assert outcomes[0].detail == (
        "clang, arm-none-eabi-gcc, qemu-system-arm not found: "
        "sudo apt-get install clang libclang-rt-dev gcc-arm-none-eabi qemu-system-arm"
    )
    assert counts(outcomes) == {PASSED: 0, FAILED: 0, NOT_DONE: 1}
    table = matrix_table(outcomes)
    assert "0/1 undone" in table
    assert "not done, 1 builds: clang, arm-none-eabi-gcc" in table


def test_every_tool_has_a_package() -> None:
    for core in cores.CORES:
        for compiler in COMPILERS:
            assert set(core.tools(compiler)) <= set(TOOLS)


def test_matrix_is_as_large_as_promised() -> None:
    builds = matrix.shipped_builds(CASES)
    cubic = [b for b in builds if b.case.name == CUBIC and b.toolset.arithmetic == PORTABLE]
    assert len(cubic) == 8 * 2 * 5 + 5  # AVR: gcc only
    assert {b.toolset.core.name for b in builds} == {core.name for core in cores.CORES}
    assert VECTORS >= 20000


def test_unit_case_is_the_shipped_shape() -> None:
    assert unit_case(ROOT / "units" / "AT-SIM").image == image_bytes(case_named(CUBIC).plan)


def test_unit_case_has_the_terms_of_the_fit(tmp_path: Path) -> None:
    unit = tmp_path / "SQUARES"
    shutil.copytree(ROOT / "units" / "AT-CHERNIAK", unit)
    text = (unit / "unit.toml").read_text(encoding="utf-8")
    terms = '\n[firmware]\nterms = "own-squares"\n'
    (unit / "unit.toml").write_text(text + terms, encoding="utf-8")
    assert unit_case(unit).plan.shape.quadratic


def test_a_core_under_qemu() -> None:
    need(*M3.tools("gcc"))
    case = case_named("AT-CHERNIAK")
    ways = [Toolset(M3, "gcc", "-O2", arithmetic) for arithmetic in (PORTABLE, LIMBS, THUMB2)]
    assert [o.detail for o in run_builds([Build(case, way) for way in ways])] == ["", "", ""]


def test_a_core_with_an_int_of_16_bits() -> None:
    """What is right only where int has 32 bits is seen: 1u shifted by 31, for one."""
    need(*AVR.tools("gcc"))
    case = case_named("AT-CHERNIAK")
    text = case.files["triax_comp.c"]
    old = "((uint32_t)p[1] << 8) | ((uint32_t)p[2] << 16) | ((uint32_t)p[3] << 24)"
    assert old in text
    wrong = text.replace(old, old.replace("(uint32_t)", "(unsigned)"))
    broken = replace(case, name="broken", files={**case.files, "triax_comp.c": wrong})
    way = replace(Toolset(AVR, "gcc", "-O2"), defines=("-Wno-shift-count-overflow",))
    right, seen = run_builds([Build(c, way) for c in (case, broken)])
    assert right.detail == ""
    assert "expected 'selftest 00000000'" in seen.detail


OPEN = """
#include "target_io.h"
#include "triax_ref.h"
static triax_ref_t ref;
static const uint8_t IMAGE[] = {%s};
int main(void)
{
    target_print("open ");
    target_print_hex(triax_ref_open(&ref, IMAGE, sizeof IMAGE));
    target_print("\\n");
    return 0;
}
"""


@pytest.mark.parametrize(("added", "status"), [(0, 0), (65536, 16)])
def test_the_reference_cuts_no_word_of_the_shape_to_16_bits(
    added: int, status: int, tmp_path: Path
) -> None:
    """An image of 65537 segments is none of one segment."""
    need(*AVR.tools("gcc"))
    words = list(struct.unpack(f"<{len(case_named(CUBIC).image) // 4}I", case_named(CUBIC).image))
    assert words[4] == 1
    words[4] += added
    image = struct.pack(f"<{len(words) - 1}I", *words[:-1])
    image += struct.pack("<I", zlib.crc32(image))
    main = tmp_path / "open.c"
    main.write_text(OPEN % ", ".join(map(str, image)))
    program = tmp_path / "program.elf"
    sources = [main, *(FIRMWARE / name for name in ("triax_ref.c", "triax_ref_image.c"))]
    build(Toolset(AVR, "gcc", "-Os"), sources, [FIRMWARE], program)
    assert emulate(AVR, program) == f"open {status:08x}\n"


def test_program_that_does_not_build_is_a_failure() -> None:
    need(*M3.tools("gcc"))
    case = case_named(CUBIC)
    broken = replace(case, files={**case.files, "triax_comp.c": "#error broken\n"})
    outcome = run_builds([Build(broken, Toolset(M3, "gcc", "-O2"))])[0]
    assert outcome.status == FAILED
    assert "#error broken" in outcome.detail


def test_thumb2_on_a_core_without_it_is_refused_by_name() -> None:
    m0 = next(core for core in cores.CORES if core.thumb1_multiply)
    need(*m0.tools("gcc"))
    outcome = run_builds([Build(case_named(CUBIC), Toolset(m0, "gcc", "-O2", THUMB2))])[0]
    assert outcome.status == FAILED
    assert "this is for cores with Thumb-2 (Cortex-M3, M4, M7, M33)" in outcome.detail


def known_program(tmp_path: Path, rounds: str) -> Path:
    """The benchmark program of the cubic with other loops than `counting.LOOP_ROUNDS`."""
    sources, include, _ = _write_subject(
        Subject(case_named(CUBIC), PORTABLE, ""), tmp_path / "work"
    )
    target = FIRMWARE / "target"
    main = tmp_path / "bench_main.c"
    text = (target / "bench_main.c").read_text()
    assert "{1, 10, 100, 1000}" in text
    main.write_text(text.replace("{1, 10, 100, 1000}", rounds))
    harness = [main, *(target / f"bench_{n}" for n in ("call.c", "stack.c", "known.S"))]
    program = tmp_path / "program.elf"
    build(Toolset(M3, "gcc", "-O2"), [*sources, *harness], include, program)
    return program


def test_counter_counts_known_loops_or_refuses(tmp_path: Path) -> None:
    need(*M3.tools("gcc"))
    plugin = build_plugin(tmp_path)
    found = measure(M3, known_program(tmp_path / "right", "{1, 10, 100, 1000}"), plugin)
    assert found.set.least == found.set.most > 12 * 3 * 2  # a multiplication and an addition a step
    assert found.apply.least == found.apply.most > 9  # a product each
    with pytest.raises(TargetError, match=r"were counted as \[3, 21, 201, 2003\]"):
        measure(M3, known_program(tmp_path / "wrong", "{1, 10, 100, 1001}"), plugin)
    assert counting.LOOP_ROUNDS == (1, 10, 100, 1000)


def test_rates_and_forces_are_given_and_counted(tmp_path: Path) -> None:
    need(*M3.tools("gcc"))
    plugin = build_plugin(tmp_path)
    costs = {
        name: cost_of(Subject(case_named(name), PORTABLE, ""), M3, tmp_path / str(i), plugin)
        for i, name in enumerate((CUBIC, ORDER_4, RATE_ALONE, GYRO))
    }
    assert [c.failure for c in costs.values()] == [""] * 4
    counts = {name: c.counts for name, c in costs.items() if c.counts}
    # Three multiplications of a rate; nine of a force, each with its load.
    assert counts[RATE_ALONE].set.least > counts[CUBIC].set.most + 3
    assert counts[RATE_ALONE].apply == counts[CUBIC].apply
    assert counts[GYRO].apply.least > counts[CUBIC].apply.most + 18
    flash = {name: c.flash for name, c in costs.items() if c.flash}
    assert flash[RATE_ALONE].tables == flash[CUBIC].tables + 4 * 6
    assert flash[GYRO].tables == flash[CUBIC].tables + 4 * 9
    # What the summary says that an order saves.
    assert counts[ORDER_4].set.least == counts[CUBIC].set.most + 12 * HORNER_STEP_ON_M3
    assert flash[ORDER_4].tables == flash[CUBIC].tables + 4 * 12


def test_a_program_that_fails_is_reported(tmp_path: Path) -> None:
    need(*M3.tools("gcc"))
    source = tmp_path / "main.c"
    source.write_text("int main(void)\n{\n    return 1;\n}\n")
    program = tmp_path / "program.elf"
    build(Toolset(M3, "gcc", "-O2"), [source], [], program)
    with pytest.raises(TargetError, match="qemu-system-arm: exit code 1"):
        emulate(M3, program)


def test_table_goes_between_the_markers() -> None:
    page = f"before\n{bench_table.BEGIN}\nold\n{bench_table.END}\nafter\n"
    once = bench_table.put_between_markers(page, "new", "page.md")
    assert once == f"before\n{bench_table.BEGIN}\n\nnew\n\n{bench_table.END}\nafter\n"
    assert bench_table.put_between_markers(once, "new", "page.md") == once
    with pytest.raises(RefusedError, match=r"page\.md: no markers of the generated table"):
        bench_table.put_between_markers("nothing", "new", "page.md")


def test_example_firmware(tmp_path: Path) -> None:
    need("arm-none-eabi-gcc", "qemu-system-arm", "gcc")
    case = case_named(CUBIC)
    generated = tmp_path / "generated"
    generated.mkdir()
    for name, text in case.files.items():
        (generated / name).write_text(text)
    (generated / "triax_calib.bin").write_bytes(case.image)
    make = ["make", "-C", str(ROOT / "examples" / "cortex-m3"), "test"]
    make += [f"GENERATED={generated}", f"BUILD={tmp_path / 'build'}"]
    done = subprocess.run(make, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "check: 8 lines as expected" in done.stdout
    # A damaged image in flash is refused, and the test of the example says so.
    (generated / "triax_calib.bin").write_bytes(bytes([case.image[0] ^ 1]) + case.image[1:])
    done = subprocess.run(make, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "calibration refused" in done.stderr + done.stdout or "refused" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n, s in COVERING.items() if not s.saturates])
def test_assembly_at_the_limits_of_every_shape(name: str) -> None:
    """Constants that spend step R's limits to the last unit, where a limb's sum could overflow."""
    need("arm-none-eabi-gcc", "qemu-system-arm", "riscv64-unknown-elf-gcc", "qemu-system-riscv32")
    shape, rng = COVERING[name], Random(name)
    rows = [
        random_rows(rng, shape.order, full=True, limit=shape.row_limit)
        if shape.inverse is None
        else random_matrix_rows(rng, shape.order)
        for _ in range(shape.segments)
    ]
    plan = integer_plan(shape, rows)
    if shape.quadratic:
        plan = with_quadratic(plan, random_quadratic(rng, full=True))
    provenance = Provenance("S", "0" * 64, ("limits",))
    files = render_routine(plan) | render_constants(plan, SENSOR, provenance)
    files |= render_selftest(plan, provenance)
    case = Case(name, "", plan, files, image_bytes(plan))
    by_name = {core.name: core for core in cores.CORES}
    ways = (
        ("Cortex-M0", THUMB1), ("Cortex-M3", THUMB2), ("Cortex-M4F", THUMB2), ("RV32IM", PORTABLE),
    )  # fmt: skip
    builds = [Build(case, Toolset(by_name[core], "gcc", "-O2", form)) for core, form in ways]
    assert [o.detail for o in run_builds(builds)] == [""] * 4


@pytest.mark.parametrize("optimisation", ["-O0", "-O2"])
@pytest.mark.parametrize("name", [CUBIC, CUBIC_LEFT, ORDER_4, RATE_ALONE])
def test_the_assembly_leaves_r9_to_the_platform(
    name: str, optimisation: str, tmp_path: Path
) -> None:
    """gcc has no macro for -ffixed-r9, so the routine could not refuse it."""
    need("arm-none-eabi-gcc", "arm-none-eabi-objdump")
    case = case_named(name).in_form(THUMB2)
    for file, text in case.files.items():
        (tmp_path / file).write_text(text)
    toolset = Toolset(M3, "gcc", optimisation, THUMB2, ("-ffixed-r9",))
    (made,) = compiled(toolset, [tmp_path / case.sources[0]], [tmp_path], tmp_path / "made")
    shown = subprocess.run(
        ["arm-none-eabi-objdump", "-d", made], capture_output=True, text=True, check=True
    ).stdout
    assert "smlal" in shown
    assert not [line for line in shown.splitlines() if re.search(r"\b(r9|sb)\b", line)]
