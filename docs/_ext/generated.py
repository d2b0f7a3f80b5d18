"""Tables of the pages that are made from declarations in the code.

A page has a region between `<!-- generated: NAME ARGUMENTS -->` and `<!-- end -->`. What stands in
it is kept in the page, so that it can be read without building the site. `make golden` writes it;
`tests/test_doc_tables.py` fails where it differs.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path

import click

from triaxcal.cli.main import SECTIONS, main
from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.registry import POSE_CAUSES
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.fixedpoint.angles import ARCSEC_PER_UNIT
from triaxcal.fixedpoint.angles_proof import prove_angles
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.reference import reference_markdown
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.readings.format import FORMATS, Format
from triaxcal.rig.description.protection import PROTECTIONS
from triaxcal.rig.hands.instrument import DRIVERS
from triaxcal.rig.logs.logfile import LOG_FORMATS
from triaxcal.rig.sources.source import SOURCES
from triaxcal.targets.shapes import unit_case

DOCS = Path(__file__).parent.parent
UNITS = DOCS.parent / "units"
_REGION = re.compile(r"(<!-- generated: ([^>\n]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _keys(kind: str, *without: str) -> str:
    """Keys of a kind of file; tables that are the same in the kinds `without` are not repeated."""
    said = {text for other in without for text in _key_tables(other)}
    return "\n\n".join(text for text in _key_tables(kind) if text not in said)


def _key_tables(kind: str) -> list[str]:
    return re.split(r"\n\n(?=\*\*)", reference_markdown(FILES[kind]()))


def _needs(entry: Format) -> str:
    present = entry.package in {"", "numpy", "scipy", *sys.stdlib_module_names}
    return "nothing" if present else f"`pip install 'triaxcal[{entry.extra}]'`"


def _formats() -> str:
    rows = ((_bare(e.label), ", ".join(e.extensions), e.doc, _needs(e)) for e in FORMATS)
    return _table(("format", "usual ending", "columns", "needs"), rows)


def _bare(label: str) -> str:
    return label.removeprefix("a ").removeprefix("an ")


def _blocks() -> str:
    rows = ((f"`{e.name}`", e.doc, str(sum(len(b.states) for b in e.blocks))) for e in EXTENSIONS)
    return _table(("name", "what it adds", "states"), rows)


def _sources() -> str:
    rows = ((f"`{e.label}`", e.doc) for e in SOURCES)
    return _table(("`--bus`", "where the frames come from"), rows)


def _drivers() -> str:
    rows = ((f'`"{e.name}"`', e.doc, ", ".join(f"`{n}`" for n in e.needs)) for e in DRIVERS)
    return _table(("`driver`", "what it speaks", "keys that it needs"), rows)


def _logs() -> str:
    return _table(("format", "what it is"), ((e.label, e.doc) for e in LOG_FORMATS))


def _commands() -> str:
    """The help of every command, as a terminal of 80 columns shows it."""
    names = [name for section in SECTIONS.values() for name in section]
    return "\n\n".join(_help(main, "triaxcal", None, names))


def _help(
    command: click.Command, name: str, above: click.Context | None, order: Iterable[str] = ()
) -> Iterator[str]:
    context = click.Context(
        command, parent=above, info_name=name, terminal_width=80, **command.context_settings
    )
    yield f"## {context.command_path}\n\n```text\n{command.get_help(context)}\n```"
    if isinstance(command, click.Group):
        for below in order or command.list_commands(context):
            found = command.get_command(context, below)
            assert found is not None
            yield from _help(found, below, context)


def _named(entries: Iterable[object]) -> str:
    rows = ((f'`"{e.name}"`', e.label, e.doc) for e in entries)  # type: ignore[attr-defined]
    return _table(("name", "in reports", "what it is"), rows)


def _causes(registry: Iterable[Cause]) -> str:
    rows = ((e.label, e.doc, e.apart) for e in registry)
    return _table(("cause", "what it is", "what would tell it from what looks the same"), rows)


def _angles_bound() -> str:
    """Terms of the proven error of triax_angles, in units, and their sums in arcsec."""
    bound = prove_angles()
    names = dict.fromkeys(t.name for t in (*bound.first, *bound.second))
    columns = [{t.name: t.units for t in terms} for terms in (bound.first, bound.second)]
    rows = [[n, *(f"{_up(c[n], 3):.3f}" if n in c else "" for c in columns)] for n in names]
    rows.append(["sum", *(f"{_up(u, 2):.2f}" for u in bound.units)])
    rows.append(["in arcsec", *(f"{_up(u * ARCSEC_PER_UNIT, 4):.4f}" for u in bound.units)])
    return _table(("term", "zenith, pitch", "tool face, roll"), rows)


def _up(value: Fraction | float, decimals: int) -> float:
    return math.ceil(value * 10**decimals) / 10**decimals


@cache
def delivered_c() -> str:
    """triax_comp.c of AT-CHERNIAK without the comments for provers."""
    text = unit_case(UNITS / "AT-CHERNIAK").files["triax_comp.c"]
    text = re.sub(r"[ \t]*/\*@.*?\*/\n?", "", text, flags=re.DOTALL)
    return re.sub(r"[ \t]*//@.*\n", "\n", text)


def functions_of(text: str) -> dict[str, str]:
    """Functions of a C file by name, each from its first line to its closing brace."""
    found = re.findall(
        r"^((?:static )?\w+ (\w+)\([^;{]*\)\n\{\n.*?^\})", text, re.DOTALL | re.MULTILINE
    )
    return {name: body for body, name in found}


def _function(*names: str) -> str:
    """Functions of the delivered C as they stand in it."""
    functions = functions_of(delivered_c())
    return "```c\n" + "\n\n".join(functions[name] for name in names) + "\n```"


TABLES: dict[str, Callable[..., str]] = {
    "function": _function,
    "keys": _keys,
    "formats": _formats,
    "blocks": _blocks,
    "methods": lambda: _named(METHODS),
    "functions": lambda: _named(THERMAL_FUNCTIONS),
    "sources": _sources,
    "protections": lambda: _named(PROTECTIONS),
    "drivers": _drivers,
    "logs": _logs,
    "commands": _commands,
    "causes": lambda: _causes(CAUSES),
    "pose-causes": lambda: _causes(POSE_CAUSES),
    "angles-bound": _angles_bound,
}


def filled(text: str) -> str:
    """A page with its regions made anew."""

    def fill(match: re.Match[str]) -> str:
        begin, what, end = match.groups()
        name, *arguments = what.split()
        return f"{begin}\n{TABLES[name](*arguments)}\n\n{end}"

    return _REGION.sub(fill, text)


def pages() -> list[Path]:
    """Pages that may have such regions."""
    return sorted(p for p in DOCS.rglob("*.md") if "_build" not in p.parts)


if __name__ == "__main__":
    for page in pages():
        text = page.read_text(encoding="utf-8")
        page.write_text(filled(text), encoding="utf-8")
