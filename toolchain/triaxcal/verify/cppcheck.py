"""cppcheck with its MISRA addon on the generated C: no finding but the deviations on file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from triaxcal.base.tools import TOOLS
from triaxcal.codegen.forms import form_of
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import render_routine, routine_file
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.arithmetic import LIMBS, PORTABLE, THUMB1, THUMB2
from triaxcal.verify.outcome import Outcome, judged
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import ANGLES, CONSTANTS, SELFTEST, Workspace

CPPCHECK = TOOLS["cppcheck"]
DEVIATIONS = Path(__file__).with_name("misra_deviations.toml")
OPTIONS = (
    "--std=c99", "--addon=misra", "--enable=warning,style,performance,portability", "--quiet",
    "--template={file}\t{line}\t{id}\t{message}", "--error-exitcode=0",
)  # fmt: skip

FORMS = {PORTABLE: (), LIMBS: (), THUMB2: ("-D__thumb__", "-D__thumb2__"), THUMB1: ("-D__thumb__",)}
"""What is defined for each form. Thumb is claimed, or the assembly would be refused."""

USER = "verify_user.c"
_USES = """#include "{triad}_calib.h"
#include "{triad}_selftest.h"
uint32_t use_{triad}(const uint8_t *image)
{{
    static {triad}_state_t state;
    (void){triad}_set_temperature(&state, &{TRIAD}_CALIB, {triad}_calib_constants.temp_min_code);
    return {triad}_calib_check(image, {TRIAD}_FILE_SIZE) | {triad}_selftest();
}}
"""
_USES_ANGLES = """#include "{triad}_angles.h"
uint32_t use_{triad}_angles(const int32_t accel[3])
{{
    {triad}_angle_t angle[2];
    return {triad}_angles(accel, angle) + (uint32_t)angle[1];
}}
"""
_RULE = re.compile(r"misra-c2012-(\d+\.\d+)")
_MACRO = re.compile(r"#define (\w+)")
_FUNCTION = re.compile(r"[A-Za-z_][\w\s*]*?(\w+)\([^;]*$")


@dataclass(frozen=True)
class Finding:
    """One complaint: file, line, MISRA rule ("" for cppcheck's own), function or macro, text."""

    file: str
    line: int
    rule: str
    place: str
    text: str

    def __str__(self) -> str:
        rule = f"MISRA {self.rule}" if self.rule else self.text
        return f"{self.file}:{self.line} ({self.place or 'file'}): {rule}"


@dataclass(frozen=True)
class Deviation:
    """A rule that is not kept in certain places, and why; * in a place is any text, as a prefix."""

    rule: str
    places: tuple[str, ...]
    reason: str

    def covers(self, finding: Finding) -> bool:
        """Whether the finding is this deviation."""
        return finding.rule == self.rule and any(
            fnmatchcase(finding.place, place) for place in self.places
        )


def check(work: Workspace) -> Outcome:
    """The routine, the constants and the self-test."""
    return judge(find_all(work))


def judge(findings: Sequence[Finding]) -> Outcome:
    """Good when the findings are none but the deviations on file."""
    deviations = read_deviations()
    left = [f for f in findings if not any(d.covers(f) for d in deviations)]
    deviated = sorted({f.rule for f in findings} - {f.rule for f in left})
    finding = f"{len(left)} findings"
    if deviated:
        finding += f"; deviations from rule {' and '.join(deviated)}"
    figures = {"version": CPPCHECK.version(), "findings": len(left), "deviations": deviated}
    return judged(
        "cppcheck",
        "cppcheck: MISRA C:2012",
        good=not left,
        finding=finding,
        figures=figures,
        details=[str(f) for f in left],
    )


def read_deviations() -> tuple[Deviation, ...]:
    """The deviations on file."""
    entries = tomllib.loads(DEVIATIONS.read_text(encoding="utf-8"))["deviation"]
    return tuple(
        Deviation(e["rule"], tuple(e["places"]), " ".join(e["reason"].split())) for e in entries
    )


def find_all(work: Workspace) -> list[Finding]:
    """Every complaint about the generated files, deviations included.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    angles = [work.named(ANGLES)] if work.angles is not None else []
    findings = find_in(work.folder, [*_sources(work.plan, PORTABLE), *angles], [work.plan])
    for form in sorted({form_of(work.plan.shape, form) for form in FORMS} - {PORTABLE}):
        plan = replace(work.plan, arithmetic=form)
        folder = work.folder / f"cppcheck_{form}"
        folder.mkdir(exist_ok=True)
        for path in work.folder.glob("*.[ch]"):
            (folder / path.name).write_bytes(path.read_bytes())
        # The assembly has a state of its own: its header is another one.
        for name, text in render_routine(plan).items():
            (folder / name).write_text(text, encoding="utf-8")
        found = find_in(folder, _sources(plan, form), [plan], FORMS[form])
        findings += [f for f in found if f.file == routine_file(plan, form)]
    return findings


def _sources(plan: Plan, form: str) -> list[str]:
    names = names_of(plan)
    return [routine_file(plan, form), *(names.file(file) for file in (CONSTANTS, SELFTEST))]


def find_in(
    folder: Path, sources: Sequence[str], plans: Sequence[Plan], defines: Sequence[str] = ()
) -> list[Finding]:
    """Every complaint about C files of a folder, which a firmware uses from a file of its own.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    uses = [_USES.format(**names_of(plan).context) for plan in plans]
    if any(source.endswith("_angles.c") for source in sources):
        uses.append(_USES_ANGLES.format(**names_of(plans[0]).context))
    (folder / USER).write_text("".join(uses), encoding="utf-8")
    answer = run([CPPCHECK.find(), *OPTIONS, *defines, *sources, USER], folder)
    if answer.code:
        raise BrokenToolError(f"cppcheck: {answer.text.strip()[-200:]}")
    findings = []
    for line in dict.fromkeys(answer.text.splitlines()):
        file, number, identity, text = [*line.split("\t", 3), "", "", ""][:4]
        if not number.isdigit():
            raise BrokenToolError(f"cppcheck: {line[:200]}")
        if file == USER:
            continue
        rule = _RULE.fullmatch(identity)
        source = (folder / file).read_text(encoding="utf-8").splitlines()
        place = place_of(source, int(number))
        findings.append(
            Finding(file, int(number), rule.group(1) if rule else "", place, f"{identity}: {text}")
        )
    return findings


def place_of(source: Sequence[str], line: int) -> str:
    """Macro defined on a line (counted from 1), or the function that it lies in, or ""."""
    macro = _MACRO.match(source[line - 1])
    if macro:
        return macro.group(1)
    for text in reversed(source[:line]):
        if text == "}" and text is not source[line - 1]:
            return ""
        head = _FUNCTION.match(text)
        if head:
            return head.group(1)
    return ""
