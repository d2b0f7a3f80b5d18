"""How a column is named: one rule for every format.

A column of a table (a sheet, a topic, a group, a structure) is `table.column`. The table may be
left out where `variable` names it, or where only one table has such a column; `[0]` before a dot
may be left out as well. Upper and lower case are the same where that leaves one column.
"""

from __future__ import annotations

from collections.abc import Sequence

_BETWEEN = (".", "/")


def meant(wanted: str, names: Sequence[str], variable: str | None) -> list[int]:
    """Indices of the columns that a name means: one, none, or several where it is ambiguous."""
    plain, short = wanted.lower(), _short(wanted)
    full = [_short(variable) + mark + short for mark in _BETWEEN] if variable else []
    ends = tuple(mark + short for mark in _BETWEEN)
    rules = (
        lambda name: name == wanted,
        lambda name: name.lower() == plain,
        lambda name: _short(name) in full,
        lambda name: _short(name) == short or _short(name).endswith(ends),
    )
    found = ([k for k, name in enumerate(names) if rule(name)] for rule in rules)
    return next((indices for indices in found if indices), [])


def in_table(table: str, names: Sequence[str]) -> bool:
    """Whether a table of that name has a column."""
    starts = tuple(_short(table) + mark for mark in _BETWEEN)
    return any(_short(name).startswith(starts) for name in names)


def _short(name: str) -> str:
    return name.lower().replace("[0].", ".")
