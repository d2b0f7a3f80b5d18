"""gcc's static analyser, and the generated C run under sanitizers on the boundary vectors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.crosscheck import VectorSet, python_routine, vector_sets
from triaxcal.resources import shipped
from triaxcal.verify.outcome import Outcome, judged
from triaxcal.verify.tools import Answer, MissingToolError, Tool, run
from triaxcal.verify.workspace import IMAGE, ROUTINE, Workspace

GCC = Tool("gcc", "gcc libc6-dev")
CLANG = Tool("clang", "clang libclang-rt-dev")
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
    """gcc -fanalyzer with every warning an error."""
    command = [GCC.find(), *FLAGS, "-fanalyzer", "-c", "-o", "verify_analyzer.o", ROUTINE]
    answer = run(command, work.folder)
    complaints = complaints_of(answer)
    good = answer.code == 0 and not complaints
    figures = {"version": GCC.version(), "findings": len(complaints)}
    finding = f"{len(complaints)} findings"
    return judged(
        "gcc_analyzer",
        "gcc -fanalyzer",
        good=good,
        finding=finding,
        figures=figures,
        details=complaints,
    )


def check_sanitizer(work: Workspace, sanitizer: Sanitizer) -> Outcome:
    """Boundary and random vectors under a sanitizer: no complaint, and Python's answers.

    Raises
    ------
    MissingToolError
        When the compiler, or its sanitizer's library, is not installed.
    """
    program = work.folder / f"verify_{sanitizer.key}"
    _build(work, sanitizer, program)
    vectors = vector_sets(work.plan, RANDOM_VECTORS)
    count = sum(len(v.temp) for v in vectors)
    given = work.folder / f"{program.name}.in"
    given.write_bytes(b"".join(_bytes_of(v) for v in vectors))
    found = work.folder / f"{program.name}.out"
    command = [str(program), given.name, found.name, IMAGE]
    answer = run(command, work.folder, {"UBSAN_OPTIONS": "print_stacktrace=0"})
    complaints = complaints_of(answer)
    if not complaints and answer.code:
        complaints = [f"exit code {answer.code}: {answer.text.strip()[-200:]}"]
    if not complaints and found.read_bytes() != _expected(work, vectors):
        complaints = ["answers differ from those of the Python model"]
    figures = {"version": sanitizer.tool.version(), "vectors": count, "findings": len(complaints)}
    finding = f"{len(complaints)} findings on {count} vectors, compiled-in constants and image"
    return judged(
        sanitizer.key,
        sanitizer.title,
        good=not complaints,
        finding=finding,
        figures=figures,
        details=complaints,
    )


def complaints_of(answer: Answer) -> list[str]:
    """Lines in which a compiler or a sanitizer complains."""
    found = (_COMPLAINT.search(line) for line in answer.text.splitlines())
    return [match.group() for match in found if match]


def _build(work: Workspace, sanitizer: Sanitizer, program: Path) -> None:
    compiler = sanitizer.tool.find()
    probe = work.folder / f"{program.name}_probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    linked = run([compiler, *sanitizer.flags, "-o", f"{program}_probe", probe.name], work.folder)
    if linked.code:
        raise MissingToolError(
            f"{sanitizer.tool.program} has no {sanitizer.flags[0]}; "
            f"sudo apt-get install {sanitizer.tool.package}"
        )
    driver = work.render(f"{program.name}.c", "verify_driver.c.j2", {})
    batch = shipped("firmware_ref")
    command = [
        compiler, "-std=c99", "-O1", "-g", *sanitizer.flags, f"-I{work.folder}", f"-I{batch}",
        "-o", str(program), driver.name, ROUTINE, str(batch / "triax_batch.c"),
    ]  # fmt: skip
    built = run(command, work.folder)
    if built.code:
        raise RuntimeError(built.text)


def _bytes_of(vectors: VectorSet) -> bytes:
    """Rows of temperature code and three raw codes."""
    return np.column_stack([vectors.temp, vectors.raw]).astype(np.int32).tobytes()


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
