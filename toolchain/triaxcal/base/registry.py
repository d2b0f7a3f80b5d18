"""Registries: everything that comes in kinds is a folder, and each kind of it one file there.

A module of the folder that defines `ENTRY` adds that entry; `Registry.add` adds one at run time, as
a plug-in or a test does. Whatever lists, explains or draws the kinds asks the registry.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean


class Entry(Protocol):
    """What every entry has: a name for files, a label and an explanation for readers."""

    @property
    def name(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def doc(self) -> str: ...


E = TypeVar("E", bound=Entry)


class Registry(Generic[E]):
    """Entries of one kind by name, in the order of their `rank` attribute, then of their names.

    Parameters
    ----------
    kind : str
        What an entry is, for messages: "thermal function".
    package : str
        Dotted name of the folder; it is read when the entries are first asked for.
    entry_type : type
        Class of the entries.
    parts : tuple of str
        Attributes that an entry must have, and not empty, besides name, label and doc.
    """

    def __init__(
        self, kind: str, package: str, entry_type: type[E], parts: tuple[str, ...] = ()
    ) -> None:
        self.kind = kind
        self._package = package
        self._type = entry_type
        self._parts = ("name", "label", "doc", *parts)
        self._entries: dict[str, E] = {}
        self._read = False

    def add(self, entry: E, source: str = "") -> None:
        """Add an entry.

        Raises
        ------
        RefusedError
            When it is of another class, lacks a part, or its name is taken; names `source`.
        """
        where = source or f"{self.kind} {getattr(entry, 'name', '') or type(entry).__name__!r}"
        if not isinstance(entry, self._type):
            raise RefusedError(
                where, f"a {type(entry).__name__}", expected=f"a {self._type.__name__}"
            )
        missing = [part for part in self._parts if not getattr(entry, part, None)]
        if missing:
            raise RefusedError(
                where,
                f"the {self.kind} lacks {', '.join(missing)}",
                expected=", ".join(self._parts),
                remedy="define every part of the entry",
            )
        if entry.name in self.entries() and self._entries[entry.name] is not entry:
            raise RefusedError(where, f"the name {entry.name!r} is taken", expected="another name")
        self._entries[entry.name] = entry
        self._sort()

    @contextmanager
    def added(self, entry: E) -> Iterator[E]:
        """`entry` for the time of a `with` block."""
        self.add(entry)
        try:
            yield entry
        finally:
            del self._entries[entry.name]

    def entries(self) -> dict[str, E]:
        """All entries by name.

        Raises
        ------
        RefusedError
            When a file of the folder cannot be loaded, or its entry lacks a part.
        """
        if not self._read:
            self._read = True
            try:
                self._load()
            except RefusedError:
                self._read = False
                raise
        return self._entries

    def _load(self) -> None:
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__, self._package + "."):
            try:
                entry = getattr(importlib.import_module(module.name), "ENTRY", None)
            except (AttributeError, ImportError, TypeError) as fault:
                raise RefusedError(
                    module.name,
                    f"the {self.kind} cannot be loaded: {fault}",
                    expected=f"an ENTRY with {', '.join(self._parts)}",
                ) from fault
            if entry is not None:
                self.add(entry, module.name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the entries, in order."""
        return tuple(self.entries())

    @property
    def explained(self) -> str:
        """What each entry is, for the documentation of a key that chooses one."""
        return " ".join(f"{entry.name}: {entry.doc}" for entry in self)

    def __iter__(self) -> Iterator[E]:
        return iter(tuple(self.entries().values()))

    def __contains__(self, name: str) -> bool:
        return name in self.entries()

    def __getitem__(self, name: str) -> E:
        """Entry of a name.

        Raises
        ------
        RefusedError
            When there is none; names those that there are.
        """
        try:
            return self.entries()[name]
        except KeyError:
            raise RefusedError(
                self.kind,
                f"found {name!r}{did_you_mean(name, self.names)}",
                expected="one of " + ", ".join(self.names),
            ) from None

    def _sort(self) -> None:
        ordered = sorted(self._entries.items(), key=lambda e: (getattr(e[1], "rank", 100), e[0]))
        self._entries = dict(ordered)
