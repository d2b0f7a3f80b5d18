"""The routine as a compiler made it, for every input, on each core whose instructions are known.

Whatever the compiler did and whatever the assembly says: the instructions of the linked program
are followed with unknown inputs, and the results are shown to be the specified integers.
"""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from typing import TYPE_CHECKING

from triaxcal.base.extras import install_command
from triaxcal.base.tools import MissingToolError, install_advice, missing_tools
from triaxcal.codegen.forms import row_words
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import arithmetic_of, render_routine, routine_file
from triaxcal.fixedpoint.shape import Shape
from triaxcal.targets.bench import best_form
from triaxcal.targets.build import TargetError, Toolset, compiled, run
from triaxcal.targets.cores.core import Core
from triaxcal.targets.cores.registry import CORES
from triaxcal.verify.binary.listing import Listing
from triaxcal.verify.outcome import NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import Workspace

if TYPE_CHECKING:
    from triaxcal.verify.binary.riscv import RiscV
    from triaxcal.verify.binary.thumb import Thumb

_KEY, _TITLE = "compiled", "compiled code, every input"
OPTIMISATION = "-O2"


def check(work: Workspace) -> Outcome:
    """Compile for each core, follow the instructions, and compare with the specification.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    shape = work.plan.shape
    if reason := not_covered(shape):
        return Outcome(_KEY, _TITLE, NOT_DONE, f"not done for {reason}")
    if importlib.util.find_spec("z3") is None:
        raise MissingToolError(f"z3 for Python not found; {install_command('proof')}")
    cores = [core for core in CORES if core.counted]
    missing = missing_tools(core.gcc for core in cores)
    if missing:
        raise MissingToolError(f"{', '.join(missing)} not found; {install_advice(missing)}")
    from triaxcal.verify.binary.values import UnprovenError  # noqa: PLC0415  imports z3

    figures, failed = {}, []
    known = [core for core in cores if not _by_library(shape, core)]
    for core in known:
        try:
            figures[core.name] = proven(work, core)
        except UnprovenError as error:
            failed.append(f"{core.name}: {error}")
    finding = f"{len(figures)} of {len(cores)} cores: every image, temperature and raw code"
    if len(known) < len(cores):
        names = ", ".join(core.name for core in cores if core not in known)
        finding += f"; {names} not done: a library forms its products"
    if failed:
        finding = f"not proven: {failed[0]}"
    return judged(
        _KEY, _TITLE, good=not failed, finding=finding, figures={"cores": figures}, details=failed
    )


def not_covered(shape: Shape) -> str:
    """Which part of a shape the proof does not know; "" where it knows all."""
    parts = {
        "the inverse form": shape.inverse is not None,
        "saturating results": shape.saturates,
        "quadratic terms": shape.quadratic,
        "a term in dT/dt": shape.rate,
    }
    return next((name for name, has in parts.items() if has), "")


def _by_library(shape: Shape, core: Core) -> bool:
    """Whether the compiler's library forms the products, whose instructions are not followed."""
    return (shape.adds_to_sums or shape.high_words) and core.no_long_multiply


def proven(work: Workspace, core: Core) -> dict[str, int]:
    """Ways through both functions, and questions that z3 answered, for one core.

    Raises
    ------
    UnprovenError
        Names the instruction or the result.
    BrokenToolError
        When the compiler or the linker refuses.
    """
    from triaxcal.verify.binary.routine import prove_routine  # noqa: PLC0415  imports z3

    plan = replace(work.plan, arithmetic=best_form(core))
    listing = Listing(disassembled(work, core))
    linked = names_of(plan).linked
    functions = f"{linked}_set_temperature", f"{linked}_apply"
    words = row_words(plan.shape, arithmetic_of(plan))
    found = prove_routine(plan.shape, words, instructions(core), listing, functions)
    return {
        "set_temperature_ways": found[0].ways,
        "apply_ways": found[1].ways,
        "questions": sum(f.questions for f in found),
    }


def instructions(core: Core) -> Thumb | RiscV:
    """What knows the instructions of a core."""
    from triaxcal.verify.binary.riscv import RiscV  # noqa: PLC0415  imports z3
    from triaxcal.verify.binary.thumb import Thumb  # noqa: PLC0415

    return RiscV() if "riscv" in core.gcc else Thumb()


def objdump(core: Core) -> str:
    """The disassembler of a core's toolchain."""
    return f"{core.gcc.removesuffix('gcc')}objdump"


def disassembled(work: Workspace, core: Core) -> str:
    """The routine in a core's fastest form, compiled and linked, as objdump lists it."""
    folder = work.folder / "compiled" / core.name
    folder.mkdir(parents=True, exist_ok=True)
    plan = replace(work.plan, arithmetic=best_form(core))
    for name, text in render_routine(plan).items():
        (folder / name).write_text(text, encoding="utf-8")
    toolset = Toolset(core, "gcc", OPTIMISATION, plan.arithmetic)
    source = folder / routine_file(plan, arithmetic_of(plan))
    program = folder / "routine.elf"
    try:
        objects = compiled(toolset, [source], [folder], folder)
        link = [core.gcc, *core.flags, "-nostdlib", "-Wl,-Ttext=0x8000", "-Wl,-e,0x8000"]
        run([*link, *objects, "-lgcc", "-o", str(program)])
        return run([objdump(core), "-d", *_PLAIN.get(core.gcc, ()), str(program)])
    except TargetError as error:
        raise BrokenToolError(f"{core.name}: {error}") from error


_PLAIN = {"riscv64-unknown-elf-gcc": ("-M", "no-aliases")}
"""So that an instruction has one name."""
