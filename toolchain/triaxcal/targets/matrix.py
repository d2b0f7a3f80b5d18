"""The matrix of builds: which, run in parallel, and what came of each."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import install_advice, missing_tools
from triaxcal.codegen.shim import write_shim
from triaxcal.targets.build import TargetError, Toolset, build, emulate, in_parallel
from triaxcal.targets.cores.core import COMPILERS
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.shapes import CUBIC, Case
from triaxcal.targets.vectors import case_header, expected_lines
from triaxcal.unit.arithmetic import LIMBS, PORTABLE, THUMB1, THUMB2

OPTIMISATIONS = ("-O0", "-O1", "-O2", "-O3", "-Os")
EVERY_WAY = tuple((c, o) for c in COMPILERS for o in OPTIMISATIONS)
PASSED, FAILED, NOT_DONE = "passed", "failed", "not done"


@dataclass(frozen=True)
class Build:
    """One build of one shape."""

    case: Case
    toolset: Toolset

    @property
    def label(self) -> str:
        """Text for readers."""
        t = self.toolset
        return f"{self.case.name}, {t.core.label}, {t.compiler} {t.optimisation}, {t.arithmetic}"


@dataclass(frozen=True)
class Outcome:
    """What came of a build: PASSED, FAILED or NOT_DONE, and why."""

    build: Build
    status: str
    detail: str


def shipped_builds(cases: Sequence[Case]) -> list[Build]:
    """Every core, compiler and optimisation for the cubic; two of them for the other shapes."""
    return [
        b
        for case in cases
        for b in _builds(
            case, EVERY_WAY if case.name == CUBIC else (("gcc", "-O2"), ("clang", "-Os"))
        )
    ]


def unit_builds(case: Case) -> list[Build]:
    """Every core, compiler and optimisation for a unit's own shape."""
    return list(_builds(case, EVERY_WAY))


def _builds(case: Case, ways: Sequence[tuple[str, str]]) -> Iterator[Build]:
    """The portable form everywhere, the limb and assembly forms where they are meant to be used.

    The limb form is tried in one more way on every core, because it is portable too.
    """
    for core in CORES:
        own = [way for way in ways if way[0] in core.compilers]
        for compiler, optimisation in own:
            yield Build(case, Toolset(core, compiler, optimisation, PORTABLE))
        for compiler, optimisation in own if core.no_long_multiply else own[2:3]:
            yield Build(case, Toolset(core, compiler, optimisation, LIMBS))
        for compiler, optimisation in own if core.thumb2_multiply else ():
            yield Build(case, Toolset(core, compiler, optimisation, THUMB2))
        for compiler, optimisation in own if core.thumb1_multiply else ():
            yield Build(case, Toolset(core, compiler, optimisation, THUMB1))


def run_builds(
    builds: Sequence[Build], progress: Callable[[Outcome, int], None] = lambda _o, _n: None
) -> list[Outcome]:
    """Build, run and judge all, in the order given; `progress` gets each as it ends."""
    done = itertools.count(1)
    with tempfile.TemporaryDirectory(prefix="triaxcal-targets-") as name:
        work = Path(name)
        sources = _write_cases(builds, work)
        expected = _expected(builds)
        jobs = [
            partial(
                _outcome,
                b,
                sources[b.case.name, b.toolset.arithmetic],
                expected[b.case.name, b.toolset.core.vectors],
                work / f"build-{i}",
            )
            for i, b in enumerate(builds)
        ]
        return in_parallel(jobs, lambda outcome: progress(outcome, next(done)))


def _write_cases(builds: Sequence[Build], work: Path) -> dict[tuple[str, str], Path]:
    """Folder of each shape in each arithmetic."""
    written: dict[tuple[str, str], Path] = {}
    wanted = {(b.case.name, b.toolset.arithmetic): b.case for b in builds}
    for (name, arithmetic), case in wanted.items():
        folder = work / f"case-{len(written)}"
        folder.mkdir()
        for file, text in case.in_form(arithmetic).files.items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "target_case.h").write_text(case_header(case), encoding="utf-8")
        written[name, arithmetic] = folder
    return written


def _expected(builds: Sequence[Build]) -> dict[tuple[str, int], dict[str, int]]:
    """Expected output for each shape and number of vectors."""
    wanted = {(b.case.name, b.toolset.core.vectors): b.case for b in builds}
    return {key: expected_lines(case, key[1]) for key, case in wanted.items()}


def _outcome(planned: Build, folder: Path, expected: dict[str, int], place: Path) -> Outcome:
    toolset = planned.toolset
    missing = missing_tools(toolset.core.tools(toolset.compiler))
    if missing:
        detail = f"{', '.join(missing)} not found: {install_advice(missing)}"
        return Outcome(planned, NOT_DONE, detail)
    firmware = shipped("firmware_ref")
    case = planned.case.in_form(toolset.arithmetic)
    sources = [
        *(folder / name for name in (*case.sources, case.selftest)),
        firmware / "triax_ref.c",
        firmware / "triax_ref_image.c",
        firmware / "target" / "test_main.c",
    ]
    program = place / "program.elf"
    try:
        shim = write_shim(folder / "names", planned.case.plan.prefix)
        build(toolset, sources, [folder, *shim, firmware], program)
        complaint = compare(emulate(toolset.core, program), expected)
    except TargetError as error:
        complaint = str(error)
    return Outcome(planned, FAILED if complaint else PASSED, complaint)


def compare(printed: str, expected: dict[str, int]) -> str:
    """First difference between what a target printed and what Python expects; "" for none."""
    wanted = [f"{name} {value:08x}" for name, value in expected.items()]
    found = printed.splitlines()
    for line, want in zip(found, wanted, strict=False):
        if line != want:
            return f"printed '{line}', expected '{want}'"
    if len(found) != len(wanted):
        return f"printed {len(found)} lines, expected {len(wanted)}"
    return ""
