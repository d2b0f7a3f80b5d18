"""Registries: everything that comes in kinds is a folder, and each kind of it one file there.

A module of the folder that defines `ENTRY` adds that entry; `Registry.add` adds one at run time, as
a plug-in or a test does. Whatever lists, explains or draws the kinds asks the registry.
"""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar, cast

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
    package : str or tuple of str
        Dotted name of the folder; it is read when the entries are first asked for. Several, where
        a room above adds entries that need it.
    entry_type : type
        Class of the entries.
    parts : tuple of str
        Attributes that must not be empty, besides name, label and doc. Fields of the class without
        a default must be there as well, and be callable where they are declared so.
    """

    def __init__(
        self,
        kind: str,
        package: str | tuple[str, ...],
        entry_type: type[E],
        parts: tuple[str, ...] = (),
    ) -> None:
        self.kind = kind
        self._packages = (package,) if isinstance(package, str) else package
        self._type = entry_type
        self._wanted = ("name", "label", "doc", *parts)
        own = [
            f for f in dataclasses.fields(cast("Any", entry_type)) if f.default is f.default_factory
        ]
        self._functions = {f.name for f in own if str(f.type).startswith("Callable")}
        self._parts = tuple(dict.fromkeys((*self._wanted, *(f.name for f in own))))
        self._entries: dict[str, E] | None = None
        self._lock = threading.RLock()

    def add(self, entry: E) -> None:
        """Add an entry.

        Raises
        ------
        RefusedError
            When it is of another class, lacks a part, or its name is taken.
        """
        where = f"{self.kind} {getattr(entry, 'name', '') or type(entry).__name__!r}"
        with self._lock:
            self._entries = self._with(self.entries(), entry, where)

    @contextmanager
    def added(self, entry: E) -> Iterator[E]:
        """`entry` for the time of a `with` block."""
        before = self.entries()
        self.add(entry)
        try:
            yield entry
        finally:
            with self._lock:
                now = self.entries()
                if entry.name not in before:
                    self._entries = {name: e for name, e in now.items() if name != entry.name}

    def entries(self) -> dict[str, E]:
        """All entries by name.

        Raises
        ------
        RefusedError
            When a file of the folder cannot be loaded, or its entry lacks a part.
        """
        if self._entries is None:
            with self._lock:  # another thread may load them at this moment
                if self._entries is None:
                    self._entries = self._loaded()
        return self._entries

    def _loaded(self) -> dict[str, E]:
        found: dict[str, E] = {}
        folders = [(name, importlib.import_module(name).__path__) for name in self._packages]
        modules = [m for name, at in folders for m in pkgutil.iter_modules(at, name + ".")]
        for module in modules:
            try:
                entry = getattr(importlib.import_module(module.name), "ENTRY", None)
            except Exception as fault:
                raise RefusedError(
                    module.name,
                    f"the {self.kind} cannot be loaded: {type(fault).__name__}: {fault}",
                    expected=f"an ENTRY with {', '.join(self._parts)}",
                ) from fault
            if entry is not None:
                found = self._with(found, entry, module.name)
        return found

    def _with(self, entries: Mapping[str, E], entry: E, where: str) -> dict[str, E]:
        """`entries` and one more, in order."""
        if not isinstance(entry, self._type):
            raise RefusedError(
                where, f"a {type(entry).__name__}", expected=f"a {self._type.__name__}"
            )
        missing = [part for part in self._parts if self._lacks(entry, part)]
        if missing:
            raise RefusedError(
                where,
                f"the {self.kind} lacks {', '.join(missing)}",
                expected=", ".join(self._parts),
                remedy="define every part of the entry",
            )
        if entries.get(entry.name, entry) is not entry:
            raise RefusedError(where, f"the name {entry.name!r} is taken", expected="another name")
        ordered = sorted(
            {**entries, entry.name: entry}.items(),
            key=lambda item: (getattr(item[1], "rank", 100), item[0]),
        )
        return dict(ordered)

    def _lacks(self, entry: E, part: str) -> bool:
        value = getattr(entry, part, None)
        if part in self._wanted:
            return not value
        return value is None or (part in self._functions and not callable(value))

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
