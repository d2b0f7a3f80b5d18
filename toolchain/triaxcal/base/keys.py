"""Keys of TOML files, each declared once: what reads it also documents it and makes its schema.

A `Key` has a name, a kind (type and range), a documentation, a unit and a default. A `TableKeys`
is the keys of one table, a `FileKeys` the tables of one file. `FileKeys.read` checks the keys of a
whole file and gives a `Values` a table; `values[KEY]` is the checked value, or the default. Where a
table is nothing but its values, a frozen dataclass declares it, with fields made by `setting`;
`values.record(cls)` makes one. The reference, the JSON Schemas and the commented files of
`triaxcal init` come from the same declarations.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from triaxcal.base.errors import RefusedError
from triaxcal.base.kinds import TEXT, Kind, WrongItemError, whole
from triaxcal.base.tomltable import did_you_mean, key_name, read_toml, shown

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

REQUIRED: Any = object()
"""Default of a key that must be there."""


@dataclass(frozen=True)
class Key(Generic[T_co]):
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
        The default for readers, where `default` is None or says too little.
    example : str
        The value as TOML, for the commented file of `triaxcal init`; "" makes it from the default.
    """

    name: str
    kind: Kind[T_co]
    doc: str
    default: T_co = REQUIRED
    unit: str = ""
    default_words: str = ""
    example: str = ""

    @property
    def required(self) -> bool:
        """Whether a table must have it."""
        return self.default is REQUIRED


FORMAT = Key("format", whole(1, 1), "Version of this format.", example="1")
"""Every file has it."""
DESCRIPTION = Key("description", TEXT, "A text for the reader; it is not used.", "")


def setting(
    kind: Kind[T], default: T = REQUIRED, unit: str = "", *, words: str = "", example: str = ""
) -> T:
    """A key as a field of a frozen dataclass.

    Its name is the field's; its documentation stands under that name in the section Attributes of
    the class's docstring. `words` are its `default_words`.
    """
    made: dict[str, Any] = {"key": Key("", kind, "", default, unit, words, example)}
    if default is REQUIRED:
        return cast("T", field(metadata=made))
    if default.__class__.__hash__ is None:
        return field(default_factory=lambda: default, metadata=made)
    return field(default=default, metadata=made)


def keys_of(record: type[Any]) -> tuple[Key[Any], ...]:
    """Keys that the fields of a dataclass declare, in their order."""
    docs: dict[str, str] = {}
    for ancestor in reversed(record.__mro__):
        docs |= _documentation(ancestor.__doc__ or "")
    return tuple(
        dataclasses.replace(made, name=f.name, doc=docs.get(f.name, ""))
        for f in dataclasses.fields(record)
        if (made := f.metadata.get("key"))
    )


@cache
def _documentation(docstring: str) -> dict[str, str]:
    """Texts of the section Attributes of a docstring, by name."""
    texts: dict[str, str] = {}
    name = ""
    for line in inspect.cleandoc(docstring).partition("Attributes\n---")[2].splitlines():
        if line.startswith(" "):
            texts[name] = f"{texts.get(name, '')} {line.strip()}".strip()
        else:
            name = line.partition(" :")[0]
    return texts


@dataclass(frozen=True)
class Values:
    """The values of one table; each is checked when it is asked for.

    Attributes
    ----------
    file, name : str
        Of the file and the table, for messages.
    given : mapping
        What the file says.
    keys : mapping
        Declarations of this file by name; they take precedence over the keys asked for.
    """

    file: str
    name: str
    given: Mapping[str, object]
    keys: Mapping[str, Key[Any]] = field(default_factory=dict)

    def __contains__(self, name: str) -> bool:
        return name in self.given

    def __bool__(self) -> bool:
        return bool(self.given)

    def __getitem__(self, key: Key[T]) -> T:
        """Value of a key, or its default.

        Raises
        ------
        RefusedError
            For a wrong type, or a value out of range; names both.
        """
        declared: Key[T] = self.keys.get(key.name, key)
        kind = declared.kind
        if key.name not in self.given:
            if declared.required:
                raise self.missing(key.name, kind.expected)
            return declared.default
        found = self.given[key.name]
        try:
            return kind.parse(found)
        except WrongItemError as wrong:
            found, kind = wrong.item, wrong.kind
        except ValueError:
            pass
        hint = did_you_mean(found, kind.choices) if isinstance(found, str) else ""
        raise RefusedError(
            self.where(key.name),
            f"found {shown(found)}{hint}",
            expected=declared.kind.expected,
            remedy=declared.kind.remedy,
        )

    def record(self, cls: type[T], **others: object) -> T:
        """Dataclass of keys with these values; `others` are its fields that are no keys."""
        return cls(**{k.name: self[k] for k in keys_of(cls)}, **others)

    def where(self, name: str) -> str:
        """Place of a key as messages name it."""
        return f"{self.file}, {key_name(self.name, name)}"

    def missing(self, name: str, expected: str, remedy: str = "") -> RefusedError:
        """Error of a key that should be there."""
        return RefusedError(self.where(name), "missing", expected=expected, remedy=remedy)

    def refuse(self, name: str, expected: str, remedy: str = "") -> RefusedError:
        """Error that names the value of a key and what should be there."""
        found = f"found {shown(self.given[name])}"
        return RefusedError(self.where(name), found, expected=expected, remedy=remedy)


@dataclass(frozen=True)
class TableKeys:
    """The keys of one table; `name` is "" for the top of the file.

    Attributes
    ----------
    optional : bool
        The table may be absent; its required keys are required only where it is given.
    each : str
        What the tables of this kind are named after, "MESSAGE" where the file has one
        [name.MESSAGE] for each message, any number of them; "" for a single table.
    many : bool
        Whether the file has any number of them without names, each as [[name]].
    """

    name: str
    doc: str
    keys: tuple[Key[Any], ...]
    optional: bool = False
    each: str = ""
    many: bool = False

    @classmethod
    def of(cls, record: type[Any], optional: bool = False) -> TableKeys:
        """Table of a dataclass of keys, whose docstring begins with "[name]: what it is.".

        "[name.EACH]: what it is." makes a table for each of something, "[[name]]: what it is." any
        number of tables without names.
        """
        name, _, doc = (record.__doc__ or "").partition("\n")[0].partition("]: ")
        many = name.startswith("[[")
        name, _, each = name.strip("[]").partition(".")
        made = doc[:1].upper() + doc[1:]
        return cls(name, made, keys_of(record), optional or bool(each) or many, each, many)

    @property
    def header(self) -> str:
        """Name in brackets as it stands in the file, an example where there are several."""
        inner = f"{self.name}.{self.each}" if self.each else self.name
        return f"[[{inner}]]" if self.many else f"[{inner}]"

    def but(self, *others: Key[Any], **changes: Mapping[str, Any]) -> TableKeys:
        """Same table with more keys, or with attributes of its keys changed, by name of the key."""
        keys = tuple(dataclasses.replace(k, **changes.get(k.name, {})) for k in self.keys)
        return dataclasses.replace(self, keys=(*keys, *others))

    def relaxed(self) -> TableKeys:
        """Same table without required keys."""
        return self.but(**{k.name: {"default": None} for k in self.keys if k.required})


@dataclass(frozen=True)
class FileKeys:
    """The tables of one kind of file.

    Attributes
    ----------
    name : str
        Of the file, as "unit.toml".
    title : str
        What it describes, in a few words.
    tables : tuple of TableKeys
        The first is the top of the file.
    first : tuple of str
        Optional keys that a first version of the file states.
    """

    name: str
    title: str
    tables: tuple[TableKeys, ...]
    first: tuple[str, ...] = ()

    def read(self, path: Path) -> Mapping[str, Values]:
        """Checked tables of a file by name; absent ones are empty.

        Of tables for each of something, those that the file has: "message.X" for [message.X],
        "equipment#2" for the second [[equipment]].

        Raises
        ------
        RefusedError
            When the file is no TOML or states another format; naming every missing and every
            unexpected key at once; for a key that should be a table.
        """
        return self.check(str(path), read_toml(path))

    def check(self, source: str, document: Mapping[str, object]) -> Mapping[str, Values]:
        """Checked tables of a document by name, as `read`; `source` is for messages."""
        file = Values(source, "", document)
        found = document.get("format", 1)  # when absent, it is among the missing
        if type(found) is not int or found != 1:
            raise file.refuse("format", "1", "another format needs a triaxcal that knows it")
        names = {table.name for table in self.tables}
        top = {name: value for name, value in document.items() if name not in names}
        given: dict[str, Mapping[str, object]] = {}
        kinds: dict[str, TableKeys] = {}
        for table in self.tables:
            values = document.get(table.name, {}) if table.name else top
            for full, inner in self._places(file, table, values).items():
                given[full], kinds[full] = inner, table
        self._refuse_wrong_keys(source, given, kinds, document)
        return {
            name: Values(source, name, given[name], {k.name: k for k in table.keys})
            for name, table in kinds.items()
        }

    def _places(self, file: Values, table: TableKeys, values: object) -> dict[str, dict[str, Any]]:
        """Tables of a kind that a file has, by where they stand in it."""
        if table.many:
            rows = values or []
            if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
                raise file.refuse(table.name, f"a table {table.header} for each")
            return {f"{table.name}#{i}": row for i, row in enumerate(rows, 1)}
        if not isinstance(values, dict):
            raise file.refuse(table.name, f"a table {table.header}")
        if not table.each:
            return {table.name: values}
        for name, inner in values.items():
            if not isinstance(inner, dict):
                raise Values(file.file, table.name, values).refuse(name, f"a table {table.header}")
        return {f"{table.name}.{name}": inner for name, inner in values.items()}

    def _refuse_wrong_keys(
        self,
        source: str,
        given: Mapping[str, Mapping[str, object]],
        kinds: Mapping[str, TableKeys],
        document: Mapping[str, object],
    ) -> None:
        missing, unexpected = [], []
        for place, table in kinds.items():
            lacking = [k.name for k in table.keys if k.required and k.name not in given[place]]
            if table.optional and table.name not in document:
                lacking = []
            out = "it" if table.many else f"[{place}]"
            without = f" (or leave {out} out)" if table.optional and lacking else ""
            missing += [key_name(place, name) for name in lacking]
            missing[-1:] = [last + without for last in missing[-1:]]
            known = {k.name for k in table.keys}
            unexpected += [
                key_name(place, name) + self._near(table, name)
                for name in given[place]
                if name not in known
            ]
        found = {"missing": missing, "unknown": unexpected}
        if parts := [f"{what}: {', '.join(keys)}" for what, keys in found.items() if keys]:
            raise RefusedError(source, "; ".join(parts))

    def _near(self, table: TableKeys, name: str) -> str:
        """Hint for an unknown key: the table where it belongs, or a near miss in its own."""
        for other in self.tables:
            if other.name != table.name and any(k.name == name for k in other.keys):
                place = other.header if other.name else "the top of the file"
                return f" (it belongs to {place})"
        tables = [] if table.name else [t.name for t in self.tables if t.name]
        return did_you_mean(name, [k.name for k in table.keys] + tables)


def each_of(tables: Mapping[str, Values], name: str) -> dict[str, Values]:
    """Tables [name.X] of a file by X."""
    start = f"{name}."
    return {n.removeprefix(start): v for n, v in tables.items() if n.startswith(start)}


def many_of(tables: Mapping[str, Values], name: str) -> list[Values]:
    """Tables [[name]] of a file, in their order."""
    return [v for n, v in tables.items() if n.startswith(f"{name}#")]
