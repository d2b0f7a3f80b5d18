"""Every check of a delivered unit, on two cores; a missing tool is named and never counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from triaxcal.base.tools import MissingToolError
from triaxcal.codegen.crosscheck import CrossCheck
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound
from triaxcal.verify import analyzers, compiled, cost, cppcheck, eva, gappa, wp
from triaxcal.verify import angles as angle_checks
from triaxcal.verify.outcome import FAILED, NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import Workspace

Check = Callable[[Workspace], Outcome]

CHECKS: tuple[tuple[str, str, Check], ...] = (
    ("gappa", "Gappa: error bound", gappa.check),
    ("eva_codes", "Eva: any int32 codes", eva.check_codes),
    ("eva_codes_limbs", "Eva: any codes, limbs", eva.check_codes_limbs),
    ("eva_image", "Eva: any image", eva.check_image),
    ("wp", "WP: C = specification", wp.check),
    ("cppcheck", "cppcheck: MISRA C:2012", cppcheck.check),
    ("gcc_analyzer", "gcc -fanalyzer", analyzers.check_gcc_analyzer),
    ("gcc_sanitizers", "gcc address, undefined", analyzers.check_gcc_sanitizers),
    ("clang_sanitizers", "clang undefined, integer", analyzers.check_clang_sanitizers),
    ("compiled", "compiled code, every input", compiled.check),
    ("cost", "instructions a call", cost.check),
)
"""Key, title and function of each check with a tool, in the order of the table."""


def verify_files(
    folder: Path,
    files: Mapping[str, bytes],
    plan: Plan,
    bound: Bound,
    angles: AnglesPlan | None = None,
) -> tuple[Outcome, ...]:
    """Run every check on delivered files; `folder` is for the work and stays behind."""
    return verify_work(Workspace.create(folder, files, plan, bound, angles))


def verify_work(work: Workspace) -> tuple[Outcome, ...]:
    """Run every check on the files of a workspace."""
    checks = CHECKS if work.angles is None else (*CHECKS, *angle_checks.CHECKS)
    with ThreadPoolExecutor(2) as pool:
        return tuple(
            pool.map(lambda check: guarded(check[0], check[1], lambda: check[2](work)), checks)
        )


def delivery_outcomes(bound: Bound, check: CrossCheck) -> tuple[Outcome, ...]:
    """What the delivery itself has proven and compared: these run in every `calib`."""
    return (
        judged(
            "exact_bound",
            "exact bound, every code",
            good=check.largest_error_lsb <= bound.lsb,
            finding=f"{bound.lsb:.3f} LSB over {bound.codes} temperature codes; "
            f"largest seen {check.largest_error_lsb:.3f}",
            figures={},
        ),
        judged(
            "cross_check",
            "cross-check",
            good=True,
            finding=f"0 mismatches on {check.total} vectors, three implementations; "
            f"{check.images} images rightly accepted or refused",
            figures={},
        ),
    )


def exit_code(outcomes: Sequence[Outcome]) -> int:
    """1 when any check failed; what was not done is no failure and no success."""
    return int(any(o.result == FAILED for o in outcomes))


def guarded(key: str, title: str, check: Callable[[], Outcome]) -> Outcome:
    """The outcome of a check; not done where its tool is missing, failed where it breaks."""
    try:
        return check()
    except MissingToolError as missing:
        return Outcome(key, title, NOT_DONE, str(missing))
    except BrokenToolError as broken:
        return Outcome(key, title, FAILED, str(broken))
