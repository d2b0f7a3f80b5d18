"""The constants of a unit in the linked program of a user: their address, and their values."""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.extras import install_command
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.image import constant_words
from triaxcal.codegen.names import names_of
from triaxcal.fixedpoint.plan import Plan

if TYPE_CHECKING:
    from elftools.elf.elffile import ELFFile

_CONSTANTS = re.compile(r"(\w+)_([0-9a-f]{8})_([0-9a-f]{8})_calib_constants")
"""Triad, shape, first digits of the inputs' hash."""
_OTHER_UNIT = "link the C of this delivery, or name the unit that the program was linked for"
_LINKED = "ET_EXEC", "ET_DYN"
_WRITABLE, _LOADED = 1, 2
"""SHF_WRITE and SHF_ALLOC."""


@dataclass(frozen=True)
class Linked:
    """Constants in a linked program.

    Attributes
    ----------
    symbol : str
        Their name in the program.
    address, size : int
        Of the constants.
    little_endian : bool
        Byte order of the core.
    writable : bool
        True where they stand in memory that the program may write.
    epk_address : int or None
        Where the text of TRIAX_CALIB_EPK stands, if the program has it.
    """

    symbol: str
    address: int
    size: int
    little_endian: bool
    writable: bool
    epk_address: int | None


def linked_constants(
    path: Path, plan: Plan, provenance: Provenance, variable: str | None = None
) -> Linked:
    """Find the constants of a plan in an ELF file.

    Constants that `triax_calib.c` defines are compared with the plan's integers. `variable` names a
    `triax_calib_t` that the program loads from an image instead; its size is compared.

    Raises
    ------
    RefusedError
        When the file is no linked ELF program, has no symbols, has not these constants, or
        pyelftools is missing.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refused_by_system(path, "read", error, expected="a linked program") from error
    try:
        from elftools.elf.elffile import ELFFile  # noqa: PLC0415  optional
    except ImportError:
        raise RefusedError(
            str(path),
            "missing package: pyelftools",
            remedy="install it: " + install_command("production"),
        ) from None
    if not content.startswith(b"\x7fELF"):
        raise RefusedError(
            str(path),
            f"begins with {content[:4].hex(' ') or 'nothing'}",
            expected="an ELF file, as the linker writes it (.elf, .axf, .out)",
            remedy="not the HEX or the bin that is made of it",
        )
    try:
        return _found(str(path), ELFFile(io.BytesIO(content)), plan, provenance, variable)
    except RefusedError:
        raise
    except Exception as error:  # a damaged file makes pyelftools raise errors of many kinds
        raise RefusedError(
            str(path),
            f"damaged, or no whole ELF file: {type(error).__name__} {error}",
            expected="the file as the linker wrote it",
        ) from error


def _found(
    place: str, elf: ELFFile, plan: Plan, provenance: Provenance, variable: str | None
) -> Linked:
    if elf["e_type"] not in _LINKED:
        raise RefusedError(
            place,
            f"not linked ({elf['e_type']}): its addresses are not final",
            expected="the program as the linker wrote it",
        )
    symbols = _defined(place, elf)
    words = constant_words(plan)
    size = 4 * len(words)
    if variable is None:
        symbol = _symbol(place, symbols, plan, provenance)
    else:
        _refuse_other_routine(place, symbols, plan)
        symbol = _variable(place, symbols, variable, size)
    section = elf.get_section(symbol["st_shndx"])
    address = symbol["st_value"]
    if variable is None:
        at = address - section["sh_addr"]
        _compare(place, section.data()[at : at + size], words, elf.little_endian)
    if address + size > 2**32:
        raise RefusedError(
            place,
            f"the constants stand at 0x{address:X}",
            expected="an address within 32 bits, as ASAP2 has them",
        )
    writable = bool(section["sh_flags"] & _WRITABLE)
    text_at = _text_address(elf, provenance.epk)
    return Linked(symbol.name, address, size, elf.little_endian, writable, text_at)


def _defined(place: str, elf: ELFFile) -> list[Any]:
    """Symbols that stand in a section."""
    symbols = list(_symbols(elf))
    if not symbols:
        raise RefusedError(
            place,
            "no symbols: the file is stripped",
            expected="the program as the linker wrote it",
            remedy="strip a copy, and give the file before",
        )
    return [s for s in symbols if isinstance(s["st_shndx"], int)]


def _refuse_other_routine(place: str, symbols: list[Any], plan: Plan) -> None:
    """A variable has no shape in its name: that of the routine must be the plan's."""
    names = names_of(plan)
    routine = re.compile(rf"{names.triad}_([0-9a-f]{{8}})_\w+")
    shapes = {m[1] for s in symbols if (m := routine.match(s.name))}
    if names.shape not in shapes:
        found = f"the shape {' and '.join(sorted(shapes))}" if shapes else "no name with a shape"
        raise RefusedError(
            place,
            f"the routine {names.triad} has {found}",
            expected=f"the shape {names.shape} of the unit",
            remedy="name a unit whose image this program takes"
            if shapes
            else "link triax_comp.c; -flto may have dissolved its functions",
        )


def _variable(place: str, symbols: list[Any], name: str, size: int) -> Any:
    """The symbol of a variable of the program."""
    found = {s["st_value"]: s for s in symbols if s.name == name}
    if len(found) != 1:
        raise RefusedError(
            place,
            f"{len(found)} variables {name}" if found else f"no variable {name}",
            expected="one triax_calib_t of this name",
            remedy="give it a name of its own" if found else "give its name as in the map file",
        )
    (symbol,) = found.values()
    if symbol["st_size"] != size:
        raise RefusedError(
            place,
            f"{name} has {symbol['st_size']} bytes",
            expected=f"the {size} bytes of triax_calib_t of this unit's shape",
            remedy="name the variable that triax_calib_load writes, or the unit's own program",
        )
    return symbol


def _symbol(place: str, symbols: list[Any], plan: Plan, provenance: Provenance) -> Any:
    """The symbol of the constants; refused with what there is instead."""
    names = names_of(plan)
    inputs = provenance.inputs_sha256[:8]
    wanted = f"{names.unit(inputs)}_calib_constants"
    defined = {s.name: s for s in symbols}
    if wanted in defined:
        return defined[wanted]
    matches = [m for m in map(_CONSTANTS.fullmatch, defined) if m]
    ours = [m for m in matches if m[1] == names.triad]
    units = sorted({m[3] for m in ours if m[2] == names.shape})
    if units:
        raise RefusedError(
            place,
            f"the constants {names.triad} are of another unit, or of earlier inputs: "
            f"{' and '.join(units)}",
            expected=f"those of the inputs {inputs}, as {names.triad.upper()}_CALIB_INPUTS of this "
            "delivery",
            remedy=_OTHER_UNIT,
        )
    if ours:
        raise RefusedError(
            place,
            f"the constants {names.triad} have the shape "
            f"{' and '.join(sorted({m[2] for m in ours}))}",
            expected=f"the shape {names.shape}",
            remedy=_OTHER_UNIT,
        )
    others = sorted(m[0] for m in matches)
    raise RefusedError(
        place,
        f"no symbol {wanted}" + (f", but {', '.join(others)}" if others else ""),
        expected="a program that uses the constants of this unit",
        remedy=_prefix_advice(sorted({m[1] for m in matches}))
        if others
        else f"compile {names.file('triax_calib.c')}, and use {names.triad.upper()}_CALIB: "
        "the linker drops what nobody uses",
    )


def _prefix_advice(triads: list[str]) -> str:
    """How to name the constants that a program has."""
    prefixes = sorted({triad.removesuffix("_gyro") for triad in triads})
    return f"if they are this unit's, say so: {' or '.join(f'--prefix {p}' for p in prefixes)}"


def _symbols(elf: ELFFile) -> Iterator[Any]:
    from elftools.elf.sections import SymbolTableSection  # noqa: PLC0415  optional

    for section in elf.iter_sections():
        if isinstance(section, SymbolTableSection):
            yield from section.iter_symbols()


def _compare(place: str, content: bytes, words: list[int], little_endian: bool) -> None:
    """Refuse constants that are not these words."""
    order = "<" if little_endian else ">"
    count = len(content) // 4
    found = struct.unpack(f"{order}{count}i", content[: 4 * count])
    wrong = [k for k, word in enumerate(words) if k >= count or found[k] != word]
    if wrong:
        first = wrong[0]
        there = found[first] if first < count else "nothing"
        raise RefusedError(
            place,
            f"{len(wrong)} of {len(words)} constants are not those of the unit, the first at byte "
            f"{4 * first} ({there})",
            expected=f"{words[first]} there",
            remedy=_OTHER_UNIT,
        )


def _text_address(elf: ELFFile, text: str) -> int | None:
    """Address of a text in what is loaded."""
    for section in elf.iter_sections():
        if section["sh_type"] == "SHT_PROGBITS" and section["sh_flags"] & _LOADED:
            at: int = section.data().find(text.encode())
            if at >= 0:
                return int(section["sh_addr"]) + at
    return None
