"""What triax_angles costs on each core, beside the same in soft double."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import install_advice, missing_tools
from triaxcal.codegen.angles import angles_linked
from triaxcal.codegen.shim import write_shim
from triaxcal.codegen.templates import int32_literal
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.targets.bench import DOUBLE, OPTIMISATION, SIZE_OPTIMISATION, best_form
from triaxcal.targets.build import TargetError, Toolset, build, compiled, in_parallel
from triaxcal.targets.cores.core import Core
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import Span, build_plugin, measure_angles
from triaxcal.targets.shapes import Case
from triaxcal.targets.sizes import code_of
from triaxcal.unit.arithmetic import PORTABLE

RANDOM = 60
SEED = 20130526
_COLUMNS = ("angles", "core", "instructions", "flash: code + helpers", "stack", "to double")


@dataclass(frozen=True)
class AnglesCost:
    """What the angles of a case cost on a core, or in double; or why it was not measured.

    Attributes
    ----------
    what : str
        The pair of angles, or "double".
    count : Span or None
        Instructions of a call.
    code, helpers, stack : int
        Bytes: the routine with its table, what libgcc adds, and the deepest mark on the stack.
    """

    what: str
    core: Core
    count: Span | None = None
    code: int = 0
    helpers: int = 0
    stack: int = 0
    failure: str = ""


def run_angles_bench(
    cases: Sequence[Case], progress: Callable[[AnglesCost], None] = lambda _c: None
) -> list[AnglesCost]:
    """Measure the angles of every case that has them, and the baseline, on every counted core.

    Raises
    ------
    TargetError
        When the plugin cannot be built.
    """
    subjects: list[Case | None] = [case for case in cases if case.angles is not None]
    cores = [core for core in CORES if core.counted]
    with tempfile.TemporaryDirectory(prefix="triaxcal-bench-") as name:
        work = Path(name)
        plugin = build_plugin(work)
        jobs = [
            partial(angles_cost, case, core, work / f"{i}-{core.name}", plugin)
            for i, case in enumerate([*subjects, None])
            for core in cores
        ]
        return in_parallel(jobs, progress)


def angles_cost(case: Case | None, core: Core, work: Path, plugin: Path) -> AnglesCost:
    """Build, count and size the angles of a case, or the baseline, on a core."""
    if case is not None:
        case = case.in_form(best_form(core))
    plan = None if case is None else case.angles
    what = DOUBLE if plan is None else plan.choice.pair
    missing = missing_tools(core.tools("gcc"))
    if missing:
        advice = f"not done: {', '.join(missing)} not found: {install_advice(missing)}"
        return AnglesCost(what, core, failure=advice)
    try:
        source, include, defines = _write(case, plan, work)
        target = shipped("firmware_ref") / "target"
        harness = [target / f"bench_{n}" for n in ("angles.c", "stack.c", "known.S")]
        fast = Toolset(core, "gcc", OPTIMISATION, PORTABLE, defines)
        build(fast, [source, *harness], include, work / "program.elf")
        count, stack = measure_angles(core, work / "program.elf", plugin)
        small = Toolset(core, "gcc", SIZE_OPTIMISATION, PORTABLE, defines)
        objects = compiled(small, [source], include, work / "small")
        root = "floating_angles"
        if plan is not None and case is not None:
            root = angles_linked(plan, case.plan.prefix)
        code, helpers = code_of(small, objects, [root], work / "small.elf")
    except TargetError as error:
        return AnglesCost(what, core, failure=str(error))
    return AnglesCost(what, core, count, code, helpers, stack)


def _write(
    case: Case | None, plan: AnglesPlan | None, work: Path
) -> tuple[Path, list[Path], tuple[str, ...]]:
    work.mkdir(parents=True)
    (work / "angles_case.h").write_text(
        _inputs(24 if plan is None else plan.output_q), encoding="utf-8"
    )
    if case is None:
        source = shipped("firmware_ref") / "target" / "bench_angles_floating.c"
        return source, [work], ("-DBENCH_REAL=double",)
    for name, text in case.files.items():
        (work / name).write_text(text, encoding="utf-8")
    shim = write_shim(work / "names", case.plan.prefix)
    return work / case.names.file("triax_angles.c"), [work, *shim], ()


def _inputs(output_q: int) -> str:
    """Text of angles_case.h: 1 g in random directions, axes, zeros, small and the largest."""
    rng = np.random.Generator(np.random.PCG64(SEED))
    unit = rng.normal(size=(RANDOM, 3))
    force = unit * 2.0**output_q / np.linalg.norm(unit, axis=1)[:, None]
    rows = np.rint(force).astype(np.int64).tolist()
    one = 1 << output_q
    rows += [[one * (i == j) * s for j in range(3)] for i in range(3) for s in (1, -1)]
    rows += [[0, 0, 0], [1, 0, 0], [0, 1, -1], [1, 2, one]]
    rows += [[INT32_MIN] * 3, [INT32_MAX] * 3, [INT32_MIN, 0, 0], [0, INT32_MIN, INT32_MAX]]
    text = ", ".join("{" + ", ".join(map(int32_literal, row)) + "}" for row in rows)
    return (
        "/* Generated by triaxcal. Do not edit. */\n#include <stdint.h>\n"
        f"#define CASE_ACCEL_COUNT {len(rows)}u\n"
        f"static const int32_t CASE_ACCEL[][3] = {{{text}}};\n"
    )


def angles_markdown(costs: Sequence[AnglesCost]) -> str:
    """Table of the angles for docs/reference/targets.md."""
    done = [c for c in costs if c.count is not None]
    mean = {c.core.name: c.count.mean for c in done if c.what == DOUBLE and c.count is not None}
    lines = [
        "Angles of one sample, [by triax_angles](../explanation/angles.md) and in double:",
        "",
        "| " + " | ".join(_COLUMNS) + " |",
        "|" + "---|" * len(_COLUMNS),
    ]
    for c in done:
        assert c.count is not None
        there = c.what != DOUBLE and c.core.name in mean
        ratio = f"{mean[c.core.name] / c.count.mean:.1f} times" if there else ""
        count = f"{c.count}" if c.what != DOUBLE else f"{c.count}, mean {c.count.mean:.0f}"
        size = f"{c.code} + {c.helpers} = {c.code + c.helpers}"
        lines.append(f"| {c.what} | {c.core.name} | {count} | {size} | {c.stack} | {ratio} |")
    lines += [f"Not measured: {c.what}, {c.core.name}: {c.failure}" for c in costs if c.failure]
    return "\n".join(lines)


def angles_rows(costs: Sequence[AnglesCost]) -> list[dict[str, Any]]:
    """Every cost, for bench.json."""
    return [{**asdict(c), "core": c.core.name} for c in costs]
