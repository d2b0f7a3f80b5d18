"""Keys of TOML files, each declared once: what reads it also documents it and makes its schema.

A `Key` has a name, a kind (type and range), a documentation, a unit and a default. A `TableKeys`
is the keys of one table, a `FileKeys` the tables of one file. `FileKeys.read` checks a file whole
and gives a `Values` a table; `values[KEY]` is the checked value, or the default. The reference, the
JSON Schema and the commented files of `triaxcal init` are made from the same declarations.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from triaxcal.base.tomltable import Table, read_tables

T = TypeVar("T")


class Kind(Generic[T]):
    """Type and range of a value: reads it, words it for the reference, and makes its schema."""

    def read(self, table: Table, key: str) -> T:
        """Value of a key that is there.

        Raises
        ------
        RefusedError
            For a wrong type, or a value out of range; names both.
        """
        raise NotImplementedError

    @property
    def words(self) -> str:
        """Type and range for the reference, as "whole, 0 to 9"."""
        raise NotImplementedError

    @property
    def schema(self) -> dict[str, Any]:
        """JSON Schema of the value."""
        raise NotImplementedError


@dataclass(frozen=True)
class Text(Kind[str]):
    """Text in quotes; `line` asks for one printable line of at most `longest` characters."""

    line: bool = False
    longest: int = 1000

    def read(self, table: Table, key: str) -> str:
        """Text, its white space folded where it is a line."""
        text = table.text(key)
        if not self.line:
            return text
        if not text.strip() or not text.isprintable() or len(text) > self.longest:
            raise table.refuse(key, f"one line of 1 to {self.longest} printable characters")
        return " ".join(text.split())

    @property
    def words(self) -> str:
        return "one line of text" if self.line else "text"

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "string"} | ({"minLength": 1} if self.line else {})


@dataclass(frozen=True)
class Word(Kind[str]):
    """One of a few words."""

    choices: tuple[str, ...]

    def read(self, table: Table, key: str) -> str:
        return table.choice(key, self.choices)

    @property
    def words(self) -> str:
        return ", ".join(f'`"{choice}"`' for choice in self.choices)

    @property
    def schema(self) -> dict[str, Any]:
        return {"enum": list(self.choices)}


@dataclass(frozen=True)
class Whole(Kind[int]):
    """A whole number from `low` to `high`."""

    low: int
    high: int

    def read(self, table: Table, key: str) -> int:
        return table.integer(key, self.low, self.high)

    @property
    def words(self) -> str:
        return f"whole, {self.low} to {self.high}"

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True)
class Number(Kind[float]):
    """A finite number from `low` to `high`."""

    low: float
    high: float

    def read(self, table: Table, key: str) -> float:
        return table.number(key, self.low, self.high)

    @property
    def words(self) -> str:
        return f"{self.low:g} to {self.high:g}"

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "number", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True)
class Rising(Kind[tuple[float, ...]]):
    """A list of rising numbers from `low` to `high`, `shortest` to `longest` of them."""

    low: float
    high: float
    shortest: int
    longest: int

    def read(self, table: Table, key: str) -> tuple[float, ...]:
        return table.rising(key, self.low, self.high, range(self.shortest, self.longest + 1))

    @property
    def words(self) -> str:
        size = f"{self.shortest}"
        if self.longest != self.shortest:
            size += f" to {self.longest}"
        return f"{size} rising numbers, {self.low:g} to {self.high:g}"

    @property
    def schema(self) -> dict[str, Any]:
        return {
            "type": "array",
            "items": {"type": "number", "minimum": self.low, "maximum": self.high},
            "minItems": self.shortest,
            "maxItems": self.longest,
        }


@dataclass(frozen=True)
class Flag(Kind[bool]):
    """True or false."""

    def read(self, table: Table, key: str) -> bool:
        value = table.values[key]
        if not isinstance(value, bool):
            raise table.refuse(key, "true or false")
        return value

    @property
    def words(self) -> str:
        return "true or false"

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Date(Kind[datetime.date]):
    """A day without quotes, as 2026-03-30."""

    def read(self, table: Table, key: str) -> datetime.date:
        value = table.values[key]
        if isinstance(value, datetime.datetime) or not isinstance(value, datetime.date):
            raise table.refuse(key, "a day without quotes, as 2026-03-30")
        return value

    @property
    def words(self) -> str:
        return "date, as 2026-03-30"

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "string", "format": "date"}


REQUIRED: Any = object()
"""Default of a key that must be there."""


@dataclass(frozen=True)
class Key(Generic[T]):
    """One key of a table.

    Attributes
    ----------
    name : str
    kind : Kind
        Type and range.
    doc : str
        What it means, a sentence or two.
    default : value, or REQUIRED
        Of an absent key.
    unit : str
        Of the value, as the reference prints it; "" for none.
    default_words : str
        The default for people, where `default` is None or says too little.
    example : str
        The value as TOML, for the commented file of `triaxcal init`; "" makes it from the default.
    """

    name: str
    kind: Kind[T]
    doc: str
    default: T = REQUIRED
    unit: str = ""
    default_words: str = ""
    example: str = ""

    @property
    def required(self) -> bool:
        """Whether a file must have it."""
        return self.default is REQUIRED


@dataclass(frozen=True)
class Values:
    """The values of one table, checked when they are asked for."""

    table: Table

    def __contains__(self, key: Key[Any]) -> bool:
        return key.name in self.table

    def __bool__(self) -> bool:
        return bool(self.table.values)

    def __getitem__(self, key: Key[T]) -> T:
        if key.name in self.table:
            return key.kind.read(self.table, key.name)
        return key.default


@dataclass(frozen=True)
class TableKeys:
    """The keys of one table; `name` is "" for the top of the file.

    Attributes
    ----------
    required_when : str
        For the reference, where the table is wanted in some files only.
    """

    name: str
    doc: str
    keys: tuple[Key[Any], ...]
    required_when: str = ""


@dataclass(frozen=True)
class FileKeys:
    """The tables of one kind of file.

    Attributes
    ----------
    name : str
        Of the file, as "unit.toml".
    title : str
        What it describes, in a few words.
    format : int
        Version that its key `format` states.
    """

    name: str
    title: str
    format: int
    tables: tuple[TableKeys, ...]

    def read(self, path: Path) -> Mapping[str, Values]:
        """Checked tables of a file by name; absent ones are empty.

        Raises
        ------
        RefusedError
            When the file is no TOML, states another format, or misses or has more keys than these.
        """
        layout = {t.name: {k.name: k.required for k in t.keys} for t in self.tables}
        tables = read_tables(path, layout, self.format)
        return {name: Values(table) for name, table in tables.items()}


def optional(key: Key[T]) -> Key[T | None]:
    """Same key with None as its default."""
    return Key(
        key.name,
        cast("Kind[T | None]", key.kind),
        key.doc,
        None,
        key.unit,
        key.default_words,
        key.example,
    )
