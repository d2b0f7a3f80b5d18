"""Every check of the angles, where a delivery has them; cppcheck sees them with the routine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import MissingToolError
from triaxcal.codegen.angles import render_angles
from triaxcal.codegen.angles_check import angle_vectors
from triaxcal.codegen.names import names_of
from triaxcal.fixedpoint.angles import AnglesPlan, angles
from triaxcal.targets.bench_angles import angles_cost
from triaxcal.targets.build import TargetError, in_parallel
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import build_plugin
from triaxcal.targets.shapes import Case
from triaxcal.unit.arithmetic import LIMBS, PORTABLE
from triaxcal.verify import analyzers, eva
from triaxcal.verify.outcome import Outcome, judged
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import ANGLES, IMAGE, Workspace

_DRIVER = "verify_eva_angles.c"


def _forms(work: Workspace) -> dict[str, str]:
    """The delivered C file, and the same with the other products, by the name of the form."""
    plan = _plan(work)
    forms = {False: PORTABLE, True: LIMBS}
    other = replace(plan, halves=not plan.halves)
    path = work.folder / f"verify_angles_{forms[other.halves]}.c"
    names = names_of(work.plan)
    path.write_text(render_angles(other, names)[work.named(ANGLES)], encoding="utf-8")
    return {forms[plan.halves]: work.named(ANGLES), forms[other.halves]: path.name}


def _eva(work: Workspace, key: str, title: str, form: str) -> Outcome:
    driver = work.render(f"{key}_{_DRIVER}", "verify/eva_angles.c.j2", {})
    entry = "verify_angles"
    sources = (_forms(work)[form], driver.name)
    return eva.analyse(work.folder, eva.Analysis(key, title, entry, {entry}, sources))


def _gcc_analyzer(work: Workspace) -> Outcome:
    found = analyzers.analyse_with_gcc(work.folder, _forms(work))
    return replace(found, key="angles_gcc_analyzer", title="angles: gcc -fanalyzer")


def _sanitizer(work: Workspace, sanitizer: analyzers.Sanitizer) -> Outcome:
    accel = np.concatenate(list(angle_vectors(_plan(work)).values()))
    found, status = angles(_plan(work), accel.astype(np.int64))
    answers = np.column_stack([found, status]) % 2**32
    own = analyzers.Sanitizer(
        f"angles_{sanitizer.key}", f"angles: {sanitizer.title}", sanitizer.tool, sanitizer.flags
    )
    batch = str(shipped("firmware_ref") / "triax_angles_batch.c")
    subject = analyzers.Subject(
        work.folder,
        work.render(f"verify_{own.key}.c", "verify/driver_angles.c.j2", {}),
        {form: (file, batch) for form, file in _forms(work).items()},
        work.named(IMAGE),
        accel.tobytes(),
        answers.astype(np.uint32).tobytes(),
    )
    outcome = analyzers.run_sanitizer(own, subject, len(accel))
    return replace(outcome, finding=outcome.finding.replace(", constants and image", ""))


def _cost(work: Workspace) -> Outcome:
    """Count the angles on every core; the number may not depend on the acceleration."""
    plan = _plan(work)
    texts = {
        p.name: p.read_text(encoding="utf-8")
        for p in sorted(work.folder.glob(f"{work.plan.prefix}_*.[ch]"))
    }
    case = Case("unit", "as delivered", work.plan, texts, work.image, plan)
    folder = work.folder / "angles_cost"
    folder.mkdir(exist_ok=True)
    try:
        plugin = build_plugin(folder)
    except TargetError as error:
        raise BrokenToolError(str(error)) from error
    cores = [core for core in CORES if core.counted]
    jobs = [partial(angles_cost, case, core, folder / core.name, plugin) for core in cores]
    costs = in_parallel(jobs, lambda _: None)
    for cost in costs:
        if cost.failure.startswith("not done"):
            raise MissingToolError(cost.failure)
        if cost.count is None:
            raise BrokenToolError(f"{cost.core.name}: {cost.failure}")
    counts = {c.core.name: c.count for c in costs if c.count is not None}
    words = ", ".join(f"{name.removeprefix('Cortex-')} {count}" for name, count in counts.items())
    return judged(
        "angles_cost",
        "angles: instructions a call",
        good=all(count.least == count.most for count in counts.values()),
        finding=words,
        figures={name: [count.least, count.most] for name, count in counts.items()},
    )


def _plan(work: Workspace) -> AnglesPlan:
    assert work.angles is not None
    return work.angles


CHECKS: tuple[tuple[str, str, Callable[[Workspace], Outcome]], ...] = (
    *(
        (key, title, lambda w, k=key, t=title, f=form: _eva(w, k, t, f))
        for key, title, form in (
            ("angles_eva", "angles: Eva, any int32", PORTABLE),
            ("angles_eva_limbs", "angles: Eva, limbs", LIMBS),
        )
    ),
    ("angles_gcc_analyzer", "angles: gcc -fanalyzer", _gcc_analyzer),
    *(
        (f"angles_{s.key}", f"angles: {s.title}", lambda w, s=s: _sanitizer(w, s))
        for s in analyzers.SANITIZERS
    ),
    ("angles_cost", "angles: instructions a call", _cost),
)
"""Key, title and function of each check of the angles."""
