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
    top = [f"{k} = {_value(k, v)}" for k, v in document.items() if not isinstance(v, Mapping)]
    for name, table in document.items():
        if isinstance(table, Mapping):
            top += ["", f"[{_key(name)}]"]
            top += [f"{_key(k)} = {_value(f'{name}.{k}', v)}" for k, v in table.items()]
    return "\n".join(top) + "\n"


def _key(name: object) -> str:
    text = str(name)
    bare = text.isascii() and text.replace("-", "").replace("_", "").isalnum()
    return text if bare else json.dumps(text)


def _value(key: str, value: Any) -> str:
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)  # TOML's basic strings escape as JSON does
    if isinstance(value, int | Decimal | datetime.date) or (
        isinstance(value, float) and math.isfinite(value)
    ):
        return str(value) if not isinstance(value, float) else repr(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(key, item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(key, v)}" for k, v in value.items()) + "}"
    raise RefusedError(
        key, f"found {value!r}", expected="text, a finite number, a date, true, false or a list"
    )
