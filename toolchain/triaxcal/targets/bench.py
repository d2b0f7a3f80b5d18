"""What a call costs: instructions, flash, RAM and stack, beside what one would write instead."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import install_advice, missing_tools
from triaxcal.codegen.forms import assembly
from triaxcal.codegen.names import Names
from triaxcal.codegen.shim import write_shim
from triaxcal.targets.bench_case import case_header, floating_macros, floating_tables
from triaxcal.targets.build import TargetError, Toolset, build, in_parallel, run
from triaxcal.targets.cores.core import Core
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import Counts, build_plugin, measure
from triaxcal.targets.shapes import (
    CUBIC,
    CUBIC_LEFT,
    GYRO,
    HIGH,
    ORDER_4,
    QUADRATIC,
    RATE_ALONE,
    Case,
)
from triaxcal.targets.sizes import Flash, flash_of
from triaxcal.unit.arithmetic import LIMBS, PORTABLE, THUMB1, THUMB2

OPTIMISATION = "-O2"
"""gcc -O1 does not fuse the multiply-accumulates."""

SIZE_OPTIMISATION = "-Os"
DOUBLE, FLOAT = "double", "float"


@dataclass(frozen=True)
class Subject:
    """What is measured: the generated routine of a shape, or a floating baseline of the same.

    `real` is "" for the generated routine, else "double" or "float".
    """

    case: Case
    arithmetic: str
    real: str

    @property
    def label(self) -> str:
        """Text for readers."""
        kind = self.real or self.arithmetic
        return f"{self.case.name}, {kind}"

    @property
    def names(self) -> Names | None:
        """Names in its C; None for a baseline."""
        return None if self.real else self.case.names


@dataclass(frozen=True)
class Cost:
    """What a subject costs on a core, or why it was not measured."""

    subject: Subject
    core: Core
    counts: Counts | None
    flash: Flash | None
    failure: str


def subjects(cases: Sequence[Case]) -> list[Subject]:
    """Every shape in every arithmetic that it has, and the baselines of the cubic."""
    result = [
        Subject(case, form, "")
        for case in cases
        for form in (PORTABLE, LIMBS, THUMB2, THUMB1)
        if _has(case, form)
    ]
    cubic = next(c for c in cases if c.name == CUBIC)
    return [*result, Subject(cubic, PORTABLE, DOUBLE), Subject(cubic, PORTABLE, FLOAT)]


def _has(case: Case, form: str) -> bool:
    """Whether a shape has the form; another form would stand for it."""
    given = assembly(case.plan.shape)
    return {THUMB2: given["thumb2"] > 0, THUMB1: given["thumb1"] > 0}.get(form, True)


BENCH_SHAPES = (
    CUBIC, CUBIC_LEFT, *HIGH.values(), ORDER_4, "AT-CHERNIAK", "inverse", QUADRATIC, RATE_ALONE,
    GYRO,
)  # fmt: skip


def run_bench(
    cases: Sequence[Case], progress: Callable[[Cost], None] = lambda _c: None
) -> list[Cost]:
    """Measure every subject on every bare-metal core.

    Raises
    ------
    TargetError
        When the plugin cannot be built.
    """
    wanted = [c for c in cases if c.name in BENCH_SHAPES]
    plan = [
        (subject, core)
        for subject in subjects(wanted)
        for core in CORES
        if core.counted and _meant_for(subject, core)
    ]
    with tempfile.TemporaryDirectory(prefix="triaxcal-bench-") as name:
        work = Path(name)
        plugin = build_plugin(work)
        jobs = [
            partial(cost_of, subject, core, work / str(i), plugin)
            for i, (subject, core) in enumerate(plan)
        ]
        return in_parallel(jobs, progress)


def _meant_for(subject: Subject, core: Core) -> bool:
    arithmetic = subject.arithmetic
    if subject.case.plan.shape.high_words:
        return core.high_multiply and arithmetic == PORTABLE
    if arithmetic in (LIMBS, THUMB1):
        return core.no_long_multiply
    return arithmetic != THUMB2 or core.thumb2_multiply


def best_form(core: Core) -> str:
    """The arithmetic that is fastest on a core."""
    if core.no_long_multiply:
        return THUMB1
    return THUMB2 if core.thumb2_multiply else PORTABLE


def compiler_versions() -> list[str]:
    """First line of --version of every cross compiler that is installed."""
    compilers = dict.fromkeys(core.gcc for core in CORES if core.counted)
    installed = [c for c in compilers if not missing_tools([c])]
    return [run([c, "--version"]).splitlines()[0] for c in installed]


def cost_of(subject: Subject, core: Core, work: Path, plugin: Path) -> Cost:
    """Build, count and size a subject on a core; `work` is made for it."""
    missing = missing_tools(core.tools("gcc"))
    if missing:
        advice = f"not done: {', '.join(missing)} not found: {install_advice(missing)}"
        return Cost(subject, core, None, None, advice)
    try:
        sources, include, defines = _write_subject(subject, work)
        toolset = Toolset(core, "gcc", OPTIMISATION, subject.arithmetic, defines)
        target = shipped("firmware_ref") / "target"
        harness = [target / f"bench_{n}" for n in ("main.c", "call.c", "stack.c", "known.S")]
        program = work / "fast" / "program.elf"
        build(toolset, [*sources, *harness], include, program)
        counts = measure(core, program, plugin)
        small = Toolset(core, "gcc", SIZE_OPTIMISATION, subject.arithmetic, defines)
        flash = flash_of(small, sources, include, work / "small", names=subject.names)
    except TargetError as error:
        return Cost(subject, core, None, None, str(error))
    return Cost(subject, core, counts, flash, "")


def _write_subject(subject: Subject, work: Path) -> tuple[list[Path], list[Path], tuple[str, ...]]:
    """Sources, include folders and macros of a subject."""
    target = shipped("firmware_ref") / "target"
    case = subject.case.in_form(subject.arithmetic)
    work.mkdir(parents=True)
    (work / "bench_case.h").write_text(case_header(case.plan), encoding="utf-8")
    if subject.real:
        (work / "floating_tables.c").write_text(
            floating_tables(case.plan, subject.real), encoding="utf-8"
        )
        defines = floating_macros(case.plan, subject.real)
        return [target / "bench_floating.c", work / "floating_tables.c"], [work], defines
    for name, text in case.files.items():
        (work / name).write_text(text, encoding="utf-8")
    defines = ("-DBENCH_GYRO",) if case.plan.shape.gyro else ()
    include = [work, *write_shim(work / "names", case.plan.prefix)]
    return [work / name for name in case.sources], include, defines
