"""Counting instructions with a QEMU plugin, checked on loops of known length in the same run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.shipped import shipped
from triaxcal.codegen.compilers import find_compiler
from triaxcal.targets.build import TargetError, emulate, run
from triaxcal.targets.cores.core import Core

LOOP_ROUNDS = (1, 10, 100, 1000)
"""As in bench_main.c; the loop of bench_known.S takes two instructions a round and one more."""


@dataclass(frozen=True)
class Span:
    """Least, most and mean instructions of a call over the inputs of a section."""

    least: int
    most: int
    mean: float

    def __str__(self) -> str:
        return str(self.least) if self.least == self.most else f"{self.least} to {self.most}"


@dataclass(frozen=True)
class Counts:
    """Instructions of a call, from the first of the routine to its return; bytes of RAM and stack.

    `set_out` and `apply_out` are with temperature and raw codes outside their ranges.
    """

    set: Span
    set_out: Span
    apply: Span
    apply_out: Span
    state_bytes: int
    calib_bytes: int
    stack_set: int
    stack_apply: int


def build_plugin(folder: Path) -> Path:
    """Compile count_plugin.c for the host."""
    plugin = folder / "count_plugin.so"
    source = shipped("firmware_ref") / "target" / "count_plugin.c"
    run([*find_compiler().command, "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-shared",
         "-fPIC", str(source), "-o", str(plugin)])  # fmt: skip
    return plugin


def measure(core: Core, program: Path, plugin: Path) -> Counts:
    """Run the benchmark program and return what each section counted.

    Raises
    ------
    TargetError
        When a loop of known length is not counted exactly.
    """
    names = ("empty_set", "empty_apply", "loop", "set", "set_out", "apply", "apply_out")
    values, sections = counted_sections(core, program, plugin, names)
    return Counts(
        set=_span(sections["set"], sections["empty_set"]),
        set_out=_span(sections["set_out"], sections["empty_set"]),
        apply=_span(sections["apply"], sections["empty_apply"]),
        apply_out=_span(sections["apply_out"], sections["empty_apply"]),
        state_bytes=values["state_bytes"],
        calib_bytes=values["calib_bytes"],
        stack_set=values["stack_set"],
        stack_apply=values["stack_apply"],
    )


def measure_angles(core: Core, program: Path, plugin: Path) -> tuple[Span, int]:
    """The same for bench_angles.c: instructions of a call, and bytes of stack.

    Raises
    ------
    TargetError
        When a loop of known length is not counted exactly.
    """
    names = ("empty_set", "empty_apply", "loop", "angles")
    values, sections = counted_sections(core, program, plugin, names)
    return _span(sections["angles"], sections["empty_apply"]), values["stack_angles"]


def counted_sections(
    core: Core, program: Path, plugin: Path, names: Sequence[str]
) -> tuple[dict[str, int], dict[str, list[int]]]:
    """What a program printed, and the counts of each call of its sections, in their order.

    Raises
    ------
    TargetError
        When a loop of known length is not counted exactly.
    """
    prefix = core.gcc.removesuffix("gcc")
    addresses = {}
    for line in run([f"{prefix}nm", str(program)]).splitlines():
        parts = line.split()
        if len(parts) == 3:
            addresses[parts[2]] = int(parts[0], 16) & ~1
    out = program.with_suffix(".counts")
    begin, end = addresses["bench_begin"], addresses["bench_end"]
    options = ["-plugin", f"{plugin},begin={begin:#x},end={end:#x},out={out}"]
    printed = [line.split() for line in emulate(core, program, options).splitlines()]
    values = {name: int(value) for name, value in printed}
    counts = [int(line) for line in out.read_text(encoding="utf-8").splitlines()]
    sections: dict[str, list[int]] = {}
    for name in names:
        sections[name], counts = counts[: values[name]], counts[values[name] :]
    overhead = sections["empty_set"][0] - 1
    expected = [2 * rounds + 1 for rounds in LOOP_ROUNDS]
    if [c - overhead for c in sections["loop"]] != expected:
        raise TargetError(
            f"{core.name}: loops of {expected} instructions were counted as "
            f"{[c - overhead for c in sections['loop']]}"
        )
    return values, sections


def _span(counts: list[int], empty: list[int]) -> Span:
    """Of calls, less what the call of an empty routine counts but for its one instruction."""
    overhead = empty[0] - 1
    mean = sum(counts) / len(counts) - overhead
    return Span(min(counts) - overhead, max(counts) - overhead, round(mean, 1))
