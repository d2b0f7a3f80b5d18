"""The languages that pages can be written in: each is a file in templates/languages."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean
from triaxcal.unit.passport import CODES, languages_folder


@dataclass(frozen=True)
class Language:
    """One language.

    Attributes
    ----------
    code : str
        Of ISO 639-1: the name of its file.
    name : str
        In the language itself.
    texts : mapping of str to str
        Texts of the pages by key; `{name}` in a text stands for a value.
    said : mapping of str to str
        By key, what triaxcal says itself: messages of the rooms below, which the file of English
        has as they are said, and each other file has in its language.
    """

    code: str
    name: str
    texts: Mapping[str, str]
    said: Mapping[str, str]


@cache
def language(code: str) -> Language:
    """The language of a code.

    Raises
    ------
    RefusedError
        When there is none; names those that there are.
    """
    if code not in CODES:
        raise RefusedError(
            "language",
            f"found {code!r}{did_you_mean(code, CODES)}",
            expected="one of " + ", ".join(CODES),
        )
    document = tomllib.loads((languages_folder() / f"{code}.toml").read_text(encoding="utf-8"))
    name, said = document.pop("name"), document.pop("said")
    return Language(code, name, MappingProxyType(_flat(document)), MappingProxyType(_flat(said)))


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, str]:
    """Texts of nested tables by their dotted keys."""
    found: dict[str, str] = {}
    for key, value in table.items():
        found |= (
            _flat(value, f"{before}{key}.") if isinstance(value, dict) else {before + key: value}
        )
    return found
