"""gcc's static analyser, and the generated C run under sanitizers on the boundary vectors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import TOOLS, MissingToolError, Tool
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.crosscheck import VectorSet, python_routine, vector_sets
from triaxcal.codegen.names import names_of
from triaxcal.verify.outcome import Outcome, judged
from triaxcal.verify.rows import rows_of
from triaxcal.verify.tools import Answer, run
from triaxcal.verify.workspace import CONSTANTS, IMAGE, SHIM, Workspace

GCC, CLANG = TOOLS["gcc"], TOOLS["clang"]
MEANT_WRAPS = Path(__file__).with_name("meant_unsigned_wraps.txt")
RANDOM_VECTORS = 20_000
"""Of each random set; the exhaustive sets are run whole."""

_COMPLAINT = re.compile(r"(runtime error|ERROR: \w+Sanitizer|error:|warning:).*")


@dataclass(frozen=True)
class Sanitizer:
    """A compiler and the run-time checks that it builds in."""

    key: str
    title: str
    tool: Tool
    flags: tuple[str, ...]


SANITIZERS = (
    Sanitizer(
        "gcc_sanitizers",
        "gcc address, undefined",
        GCC,
        ("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    ),
    Sanitizer(
        "clang_sanitizers",
        "clang undefined, integer",
        CLANG,
        (
            "-fsanitize=undefined,integer",
            "-fno-sanitize-recover=all",
            f"-fsanitize-ignorelist={MEANT_WRAPS}",
        ),
    ),
)


def check_gcc_analyzer(work: Workspace) -> Outcome:
    """gcc -fanalyzer with every warning an error, on both forms."""
    return analyse_with_gcc(work.folder, work.forms)


def analyse_with_gcc(folder: Path, forms: Mapping[str, str]) -> Outcome:
    """The same for files of a folder, by the name of the form."""
    complaints: list[str] = []
    good = True
    for name, routine in forms.items():
        flags = [*FLAGS, "-fanalyzer", "-c", "-o", f"verify_analyzer_{name}.o"]
        answer = run([GCC.find(), *flags, routine], folder)
        complaints += complaints_of(answer)
        good = good and answer.code == 0
    figures = {"version": GCC.version(), "findings": len(complaints)}
    return judged(
        "gcc_analyzer",
        "gcc -fanalyzer",
        good=good and not complaints,
        finding=f"{len(complaints)} findings",
        figures=figures,
        details=complaints,
    )


def check_sanitizer(work: Workspace, sanitizer: Sanitizer) -> Outcome:
    """Boundary and random vectors under a sanitizer, both forms: no complaint, Python's answers.

    Raises
    ------
    MissingToolError
        When the compiler, or its sanitizer's library, is not installed.
    """
    vectors = vector_sets(work.plan, RANDOM_VECTORS)
    count = sum(len(v.temp) for v in vectors)
    names = names_of(work.plan).default
    batch = shipped("firmware_ref") / names.file("triax_batch.c")
    subject = Subject(
        work.folder,
        work.render(f"verify_{sanitizer.key}.c", "verify/driver.c.j2", {"triad": names.triad}),
        {form: (file, work.named(CONSTANTS), str(batch)) for form, file in work.forms.items()},
        work.named(IMAGE),
        b"".join(rows_of(work.plan, v) for v in vectors),
        _expected(work, vectors),
    )
    return run_sanitizer(sanitizer, subject, count)


@dataclass(frozen=True)
class Subject:
    """What runs under a sanitizer: a driver and files, an image, vectors and the right answers.

    `sources` are by the name of the form.
    """

    folder: Path
    driver: Path
    sources: Mapping[str, tuple[str, ...]]
    image: str
    vectors: bytes
    answers: bytes


def run_sanitizer(sanitizer: Sanitizer, subject: Subject, count: int) -> Outcome:
    """Run both forms on `count` vectors.

    Raises
    ------
    MissingToolError
        When the compiler, or its sanitizer's library, is not installed.
    """
    _probe(subject.folder, sanitizer)
    complaints = [
        f"{name} form: {complaint}"
        for name in subject.sources
        for complaint in _run_form(subject, sanitizer, name)
    ]
    figures = {"version": sanitizer.tool.version(), "vectors": count, "findings": len(complaints)}
    return judged(
        sanitizer.key,
        sanitizer.title,
        good=not complaints,
        finding=f"{len(complaints)} findings on {count} vectors, constants and image, "
        f"{' and '.join(subject.sources)} form",
        figures=figures,
        details=complaints,
    )


def _run_form(subject: Subject, sanitizer: Sanitizer, form: str) -> list[str]:
    """Complaints of one form, or that its answers differ."""
    folder = subject.folder
    program = folder / f"verify_{sanitizer.key}"
    given, found = program.with_suffix(".in"), program.with_suffix(".out")
    given.write_bytes(subject.vectors)
    command = [
        sanitizer.tool.find(), "-std=c99", "-O1", "-g", *sanitizer.flags,
        f"-I{folder}", f"-I{folder / SHIM}", f"-I{shipped('firmware_ref')}",
        "-o", str(program), subject.driver.name, *subject.sources[form],
    ]  # fmt: skip
    built = run(command, folder)
    if built.code:
        return complaints_of(built) or [built.text[-200:]]
    answer = run([str(program), given.name, found.name, subject.image], folder)
    complaints = complaints_of(answer)
    if not complaints and answer.code:
        return [f"exit code {answer.code}: {answer.text.strip()[-200:]}"]
    if not complaints and found.read_bytes() != subject.answers:
        return ["answers differ from those of the Python model"]
    return complaints


def complaints_of(answer: Answer) -> list[str]:
    """Lines in which a compiler or a sanitizer complains."""
    found = (_COMPLAINT.search(line) for line in answer.text.splitlines())
    return [match.group() for match in found if match]


def _probe(folder: Path, sanitizer: Sanitizer) -> None:
    """Link nothing but the sanitizer's own library."""
    compiler = sanitizer.tool.find()
    probe = folder / f"verify_{sanitizer.key}_probe.c"
    probe.write_text("int main(void) { return 0; }\n", encoding="utf-8")
    program = str(probe.with_suffix(""))
    if run([compiler, *sanitizer.flags, "-o", program, probe.name], folder).code:
        raise MissingToolError(
            f"{sanitizer.tool.program} has no {sanitizer.flags[0]}; "
            f"{sanitizer.tool.install_command()}"
        )


def _expected(work: Workspace, vectors: list[VectorSet]) -> bytes:
    """Rows of three accelerations and the status, for the constants and again for the image."""
    routine = python_routine(work.plan)
    rows = []
    for v in vectors:
        accel, status = routine(v.temp, v.raw)
        rows.append(np.column_stack([accel, status.view(np.int32)]).astype(np.int32).tobytes())
    return b"".join(rows) * 2


def check_gcc_sanitizers(work: Workspace) -> Outcome:
    """gcc's address and undefined-behaviour sanitizers."""
    return check_sanitizer(work, SANITIZERS[0])


def check_clang_sanitizers(work: Workspace) -> Outcome:
    """clang's undefined-behaviour and integer sanitizers; meant wraps are in `MEANT_WRAPS`."""
    return check_sanitizer(work, SANITIZERS[1])
