"""TOML text of tables that a program gives."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError


def toml_text(document: Mapping[str, Any]) -> str:
    """TOML of a document: the keys of the top, then a table for each mapping.

    Raises
    ------
    RefusedError
        For a value that TOML cannot hold.
    """
    top = [
        f"{k} = {toml_value(v, str(k))}" for k, v in document.items() if not isinstance(v, Mapping)
    ]
    for name, table in document.items():
        if isinstance(table, Mapping):
            top += ["", f"[{_key(name)}]"]
            top += [f"{_key(k)} = {toml_value(v, f'{name}.{k}')}" for k, v in table.items()]
    return "\n".join(top) + "\n"


def _key(name: object) -> str:
    text = str(name)
    bare = text.isascii() and text.replace("-", "").replace("_", "").isalnum()
    return text if bare else json.dumps(text)


def toml_value(value: Any, place: str = "value") -> str:
    """One value in TOML; `place` is for messages.

    Raises
    ------
    RefusedError
        For a value that TOML cannot hold.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, str | bool):
        # TOML's basic strings escape as JSON does, and DEL besides.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float) and math.isfinite(value):
        return repr(value).removesuffix(".0")
    if isinstance(value, int | Decimal | datetime.date):
        return str(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item, place) for item in value) + "]"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {toml_value(v, place)}" for k, v in value.items())
        return "{" + inner + "}"
    raise RefusedError(
        place, f"found {value!r}", expected="text, a finite number, a date, true, false or a list"
    )
