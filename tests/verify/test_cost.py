"""What a call costs: counted on every core, and a routine whose cost varies does not pass."""

from __future__ import annotations

import pytest

from triaxcal.targets.bench import Cost, Subject, best_form
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import Counts, Span
from triaxcal.targets.shapes import Case
from triaxcal.targets.sizes import Flash
from triaxcal.verify import cost
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import ROUTINE, Workspace
from verify.conftest import Planter, needs

BARE = [core for core in CORES if core.counted]
CROSS = ("arm-none-eabi-gcc", "riscv64-unknown-elf-gcc", "qemu-system-arm", "qemu-system-riscv32")


def counted(work: Workspace, core_number: int, most: int) -> Cost:
    core = BARE[core_number]
    case = Case("unit", "", work.plan, {}, b"")
    span = Span(100, 100, 100.0)
    counts = Counts(span, span, Span(30, most, 30.0), span, 48, 212, 16, 28)
    return Cost(Subject(case, best_form(core), ""), core, counts, Flash(280, 212, 2, 636), "")


def test_cost_that_depends_on_the_input_fails(plant: Planter) -> None:
    work = plant("direct-two-segments")
    same = cost.outcome_of([counted(work, 0, 30), counted(work, 1, 30)])
    assert (same.result, same.finding) == (
        PASSED, "set_temperature + apply: M0 100 + 30, M3 100 + 30",
    )  # fmt: skip
    varying = cost.outcome_of([counted(work, 0, 30), counted(work, 1, 31)])
    assert varying.result == FAILED
    assert varying.finding.endswith("M3 100 + 30 to 31; apply depends on its input on M3")
    assert varying.figures["cores"]["Cortex-M3"]["apply"] == [30, 31]
    assert varying.figures["cores"]["Cortex-M0"]["flash_bytes"]["total"] == 494


def test_on_a_core_with_assembly_for_the_shape_a_cost_that_varies_fails(plant: Planter) -> None:
    """Cortex-M0: without assembly, as for a gyro, it is told only (test_imu_tools)."""
    outcome = cost.outcome_of([counted(plant("direct-two-segments"), 0, 31)])
    assert outcome.result == FAILED
    assert outcome.finding.endswith("apply depends on its input on M0")


def test_each_core_has_its_fastest_form() -> None:
    thumb2 = dict.fromkeys(["Cortex-M3", "Cortex-M4F", "Cortex-M7", "Cortex-M33"], "thumb2")
    others = {"Cortex-M0": "thumb1", "RV32IM": "portable"}
    assert {core.name: best_form(core) for core in BARE} == {**thumb2, **others}


@needs(*CROSS)
@pytest.mark.slow
def test_a_delivered_unit(plant: Planter) -> None:
    outcome = cost.check(plant("direct-two-segments"))
    assert outcome.result == PASSED, outcome
    assert list(outcome.figures["cores"]) == [core.name for core in BARE]


@needs(*CROSS)
def test_a_routine_that_does_not_build_fails(plant: Planter) -> None:
    work = plant("inverse")
    (work.folder / ROUTINE).write_text("#error broken\n")
    with pytest.raises(BrokenToolError, match=r"RV32IM: .*#error broken"):
        cost.check(work)
