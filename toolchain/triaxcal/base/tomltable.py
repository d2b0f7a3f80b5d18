"""TOML files read strictly: keys checked once, then every value by type and range.

Decimal numbers are kept as `decimal.Decimal` until a getter turns them into floats, so that a
table of printed numbers can also be had exactly.
"""

from __future__ import annotations

import datetime
import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from pathlib import Path

from triaxcal.base.errors import RefusedError

Layout = Mapping[str, Mapping[str, bool]]
"""Keys of each table, "" being the top level; True where the key is required."""


def shown(value: object) -> str:
    """Value as a message shows it: quoted where it is text, at most 40 characters."""
    if isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, int) and abs(value) > 10**40:
        text = "a huge number"
    elif isinstance(value, int | float | Decimal | datetime.date | datetime.time):
        text = str(value)
    elif isinstance(value, list):
        text = "[" + ", ".join(shown(item) for item in value) + "]"
    elif isinstance(value, dict):
        text = "a table"
    else:
        text = ascii(value) if not str(value).isprintable() else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def did_you_mean(found: str, known: Iterable[str]) -> str:
    """Hint ' (did you mean "x"?)' for a near miss, else nothing."""
    near = difflib.get_close_matches(found.lower(), {k.lower(): k for k in known}, n=1)
    return f' (did you mean "{next(k for k in known if k.lower() == near[0])}"?)' if near else ""


def read_toml(path: Path) -> dict[str, object]:
    """Document of a TOML file, decimals as `Decimal`.

    Raises
    ------
    RefusedError
        When the file cannot be read, is not UTF-8, or is not TOML.
    """
    return _document(path, _content(path))


def has_table(path: Path, name: str) -> bool:
    """Whether the top level of a TOML file has the key `name`, a word.

    Raises
    ------
    RefusedError
        As `read_toml`; a file without the letters of `name` is not parsed.
    """
    # Most files have none of the tables that are asked for: a thousand parses are saved.
    content = _content(path)
    return name.encode() in content and name in _document(path, content)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RefusedError(str(path), f"cannot be read: {error.strerror}") from error


def _document(path: Path, content: bytes) -> dict[str, object]:
    where = str(path)
    try:
        # utf-8-sig: editors that write a byte order mark are common, and it is harmless.
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RefusedError(
            where, f"byte {error.start} is not UTF-8", remedy="save the file as UTF-8"
        ) from error
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except (ValueError, ArithmeticError, RecursionError) as error:
        raise RefusedError(where, f"not TOML: {error}") from error


@dataclass(frozen=True)
class Table:
    """One table whose keys have been checked; getters check type and range.

    Every getter raises `RefusedError` for a wrong type or a value out of range. Absent optional
    keys are asked for with `in`.
    """

    file: str
    name: str
    values: Mapping[str, object]

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def where(self, key: str) -> str:
        """Place of a key as messages name it."""
        return f"{self.file}, {key_name(self.name, key)}"

    def refuse(self, key: str, expected: str, remedy: str = "") -> RefusedError:
        """Error that names the value of `key` and what should be there."""
        return RefusedError(
            self.where(key), f"found {shown(self.values[key])}", expected=expected, remedy=remedy
        )

    def text(self, key: str) -> str:
        """Text."""
        value = self.values[key]
        if not isinstance(value, str):
            raise self.refuse(key, "text in quotes")
        return value

    def choice(self, key: str, choices: Sequence[str]) -> str:
        """One of a few words."""
        expected = "one of " + ", ".join(f'"{c}"' for c in choices)
        value = self.values[key]
        if not isinstance(value, str):
            raise self.refuse(key, expected)
        if value not in choices:
            hint = did_you_mean(value, choices)
            raise RefusedError(self.where(key), f"found {shown(value)}{hint}", expected=expected)
        return value

    def integer(self, key: str, low: int, high: int) -> int:
        """Whole number from `low` to `high`."""
        value = self.values[key]
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.refuse(key, f"a whole number from {low} to {high}")
        return value

    def number(self, key: str, low: float, high: float) -> float:
        """Finite number from `low` to `high`."""
        value = _finite(self.values[key])
        if value is None or not low <= float(value) <= high:
            raise self.refuse(key, f"a number from {low:g} to {high:g}")
        return float(value)

    def decimals(self, key: str, length: int) -> tuple[Decimal, ...]:
        """List of `length` finite numbers, exactly as written."""
        return self._list(key, f"a list of {length} numbers", range(length, length + 1))

    def rising(self, key: str, low: float, high: float, lengths: range) -> tuple[float, ...]:
        """List of rising numbers from `low` to `high`; `lengths` are the legal lengths."""
        size = str(lengths[0]) if len(lengths) == 1 else f"{lengths[0]} to {lengths[-1]}"
        expected = f"a list of {size} rising numbers from {low:g} to {high:g}"
        values = [float(value) for value in self._list(key, expected, lengths)]
        rises = all(a < b for a, b in pairwise(values))
        if not rises or not all(low <= value <= high for value in values):
            raise self.refuse(key, expected)
        return tuple(values)

    def _list(self, key: str, expected: str, lengths: range) -> tuple[Decimal, ...]:
        raw = self.values[key]
        numbers = [_finite(item) for item in raw] if isinstance(raw, list) else []
        finite = tuple(number for number in numbers if number is not None)
        if not isinstance(raw, list) or len(raw) not in lengths or len(finite) != len(raw):
            raise self.refuse(key, expected)
        return finite


def read_tables(path: Path, layout: Layout, version: int) -> dict[str, Table]:
    """Tables of a file whose `format` is `version` and whose keys are exactly those of `layout`.

    Raises
    ------
    RefusedError
        As `read_toml`; for another format; naming every missing and every unexpected key at
        once; for a key that should be a table.
    """
    document = read_toml(path)
    found = document.get("format", version)  # when absent, it is listed with the other missing
    if type(found) is not int or found != version:
        raise RefusedError(
            f"{path}, format",
            f"found {shown(found)}",
            expected=str(version),
            remedy="another format needs a triaxcal that knows it",
        )
    return _checked_tables(str(path), document, layout)


def _checked_tables(file: str, document: Mapping[str, object], layout: Layout) -> dict[str, Table]:
    tables = {"": {k: v for k, v in document.items() if k not in layout}}
    for name in layout:
        if name:
            table = document.get(name, {})
            if not isinstance(table, dict):
                raise RefusedError(
                    f"{file}, {name}", f"found {shown(table)}", expected=f"a table [{name}]"
                )
            tables[name] = table
    missing = [
        key_name(name, key)
        for name, keys in layout.items()
        for key, required in keys.items()
        if required and key not in tables[name]
    ]
    unexpected = [
        key_name(name, key) + _near_key(name, key, layout)
        for name, table in tables.items()
        for key in table
        if key not in layout[name]
    ]
    if missing or unexpected:
        parts = ["missing: " + ", ".join(missing)] if missing else []
        parts += ["unknown: " + ", ".join(unexpected)] if unexpected else []
        raise RefusedError(file, "; ".join(parts))
    return {name: Table(file, name, values) for name, values in tables.items()}


def _near_key(table: str, key: str, layout: Layout) -> str:
    """Hint for an unknown key: a near miss in its table, or the table where it belongs."""
    for name, keys in layout.items():
        if name != table and key in keys:
            return f" (it belongs to {f'[{name}]' if name else 'the top of the file'})"
    known = list(layout[table]) + ([name for name in layout if name] if not table else [])
    return did_you_mean(key, known)


def key_name(table: str, key: str) -> str:
    """A key as messages name it, as "[adc] bits"."""
    shown_key = key if key.isprintable() and len(key) <= 40 else ascii(key)[:40]
    return f"[{table}] {shown_key}" if table else shown_key


def _finite(value: object) -> Decimal | None:
    """Value as a finite number that a float can hold; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        return None
    number = Decimal(value)
    return number if number.is_finite() and math.isfinite(float(number)) else None
