"""Bytes of flash: the routine's own code, its tables, and the helpers it pulls from libgcc."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.codegen.names import Names
from triaxcal.targets.build import Toolset, compiled, link_command, run


@dataclass(frozen=True)
class Flash:
    """Bytes of flash of set_temperature and apply with everything they need.

    Attributes
    ----------
    code, tables, helpers : int
        The routine's own instructions and literals; its constants; what libgcc adds.
    loader : int
        Code that triax_calib_load adds to that; 0 for a baseline.
    """

    code: int
    tables: int
    helpers: int
    loader: int

    @property
    def total(self) -> int:
        """Code, tables and helpers."""
        return self.code + self.tables + self.helpers


def flash_of(
    toolset: Toolset,
    sources: Sequence[Path],
    include: Sequence[Path],
    work: Path,
    *,
    names: Names | None,
) -> Flash:
    """Link the routine alone, without start-up code, and take its sections apart.

    `names` are those in its C; None for a baseline.
    """
    objects = compiled(toolset, sources, include, work)
    linked = "floating" if names is None else names.linked
    roots = [f"{linked}_set_temperature", f"{linked}_apply"]
    tables_root = "FLOATING_CALIB" if names is None else _constants(toolset, objects, linked)
    code, helpers = _text(toolset, objects, roots, work / "routine.elf")
    _, tables = _text(toolset, objects, [tables_root], work / "tables.elf")
    loader = 0
    if names is not None:
        whole = _text(toolset, objects, [*roots, f"{linked}_calib_load"], work / "whole.elf")
        loader = sum(whole) - code - helpers
    return Flash(code, tables, helpers, loader)


def code_of(
    toolset: Toolset, objects: Sequence[str], roots: Sequence[str], program: Path
) -> tuple[int, int]:
    """Bytes of the first object's code and tables that `roots` keep, and of everything else."""
    return _text(toolset, objects, roots, program)


def _symbols(toolset: Toolset, file: str) -> list[tuple[str, str]]:
    """Kinds and names of an object's symbols."""
    nm = toolset.core.gcc.removesuffix("gcc") + "nm"
    rows = [line.split() for line in run([nm, file]).splitlines()]
    return [(row[-2], row[-1]) for row in rows]


def _constants(toolset: Toolset, objects: Sequence[str], linked: str) -> str:
    """Link name of the pointer to the constants, which carries the unit: whichever it is."""
    wanted = re.compile(rf"{linked}_[0-9a-f]{{8}}_in_use")
    found = {n for o in objects for _, n in _symbols(toolset, o) if wanted.fullmatch(n)}
    (name,) = found
    return name


def _text(
    toolset: Toolset, objects: Sequence[str], roots: Sequence[str], program: Path
) -> tuple[int, int]:
    """Bytes of code of the first object, and of everything else, that `roots` keep."""
    core = toolset.core
    link = [*link_command(core), f"-Wl,-e,{roots[0]}", *(f"-Wl,-u,{r}" for r in roots)]
    run([*link, "-Wl,-z,noexecstack", *objects, "-lgcc", "-o", str(program)])
    prefix = core.gcc.removesuffix("gcc")
    own = {name for kind, name in _symbols(toolset, objects[0]) if kind in "tTrR"}
    total = 0
    for line in run([f"{prefix}size", "-A", "-d", str(program)]).splitlines():
        parts = line.split()
        if len(parts) == 3 and parts[0] in (".text", ".data"):
            total += int(parts[1])
    code = 0
    for line in run([f"{prefix}nm", "-S", str(program)]).splitlines():
        parts = line.split()
        if len(parts) == 4 and parts[3] in own:
            code += int(parts[1], 16)
    return code, total - code
