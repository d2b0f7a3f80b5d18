"""What a call costs on each core: counted under QEMU, and the same for every input in range."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial

from triaxcal.base.tools import install_advice, missing_tools
from triaxcal.codegen.forms import assembly
from triaxcal.codegen.render import render_routine
from triaxcal.targets.bench import Cost, Subject, best_form, compiler_versions, cost_of
from triaxcal.targets.build import TargetError, in_parallel
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import build_plugin
from triaxcal.targets.shapes import Case
from triaxcal.verify.outcome import NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import CONSTANTS, HEADERS, ROUTINE, Workspace

_KEY, _TITLE = "cost", "instructions a call"
_FILES = (ROUTINE, CONSTANTS, *HEADERS)


def check(work: Workspace) -> Outcome:
    """Count both calls on every core in its fastest form; triax_apply may not depend on its input.

    Raises
    ------
    BrokenToolError
        When something does not build or run.
    """
    cores = [core for core in CORES if core.counted]
    missing = missing_tools(["gcc", *(tool for core in cores for tool in core.tools("gcc"))])
    if missing:
        finding = f"{', '.join(missing)} not found; {install_advice(missing)}"
        return Outcome(_KEY, _TITLE, NOT_DONE, finding)
    names = [work.named(name) for name in _FILES]
    files = render_routine(work.plan)
    files |= {name: (work.folder / name).read_text(encoding="utf-8") for name in names}
    case = Case("unit", "as delivered", work.plan, files, work.image)
    folder = work.folder / "cost"
    folder.mkdir(exist_ok=True)
    try:
        plugin = build_plugin(folder)
    except TargetError as error:
        raise BrokenToolError(str(error)) from error
    jobs = [
        partial(cost_of, Subject(case, best_form(core), ""), core, folder / core.name, plugin)
        for core in cores
    ]
    costs = in_parallel(jobs, lambda _: None)
    for cost in costs:
        if cost.failure:
            raise BrokenToolError(f"{cost.core.name}: {cost.failure}")
    return outcome_of(costs)


def outcome_of(costs: list[Cost]) -> Outcome:
    """The outcome of what was counted: good when triax_apply costs the same for every input.

    That is not promised where a library forms the products: on cores without a long multiplication,
    of shapes that have no assembly for them.
    """
    ranges, varying, figures = [], [], {}
    failed = False
    for cost in costs:
        assert cost.counts is not None
        assert cost.flash is not None
        n, name = cost.counts, cost.core.name.removeprefix("Cortex-")
        ranges.append(f"{name} {n.set} + {n.apply}")
        if n.apply.least != n.apply.most:
            varying.append(name)
            promised = bool(assembly(cost.subject.case.plan.shape)["thumb1"])
            failed = failed or promised or not cost.core.no_long_multiply
        figures[cost.core.name] = {
            "form": cost.subject.arithmetic,
            "set_temperature": [n.set.least, n.set.most],
            "apply": [n.apply.least, n.apply.most],
            "flash_bytes": {**asdict(cost.flash), "total": cost.flash.total},
            "state_bytes": n.state_bytes,
            "stack_bytes": {"set_temperature": n.stack_set, "apply": n.stack_apply},
        }
    finding = f"set_temperature + apply: {', '.join(ranges)}"
    if varying:
        finding += f"; apply depends on its input on {', '.join(varying)}"
    return judged(
        _KEY,
        _TITLE,
        good=not failed,
        finding=finding,
        figures={"compilers": compiler_versions(), "cores": figures},
    )
