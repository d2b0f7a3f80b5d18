"""Results as plain data for JSON, and back: dataclasses of numbers, text, arrays and each other.

A dataclass becomes an object of its fields, an array nested lists, a number that is not finite
null. The types of the fields say how to read it back; the null of a number is NaN again. A class
that stands for several has a form of its own: `Custom`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
Custom = Mapping[type, tuple[Callable[[Any], Any], Callable[[Any], Any]]]
"""Classes that are not written field by field: how each is written, and read."""


def plain(value: Any, custom: Custom | None = None) -> Any:
    """`value` as objects, lists, text, numbers and null."""
    for kind, (write, _) in (custom or {}).items():
        if isinstance(value, kind):
            return write(value)
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name), custom) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return _without_nan(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item, custom) for item in value]
    if isinstance(value, Mapping):
        return {key: plain(item, custom) for key, item in value.items()}
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def rebuilt(kind: type[T], data: Any, custom: Custom | None = None) -> T:
    """Value of a class from what `plain` made of it.

    Raises
    ------
    KeyError, TypeError, ValueError
        When the data are not what `plain` writes for this class.
    """
    value: T = _read(kind, data, custom or {})
    return value


def _without_nan(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _read(kind: Any, data: Any, custom: Custom) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    value = data
    if origin in (typing.Union, types.UnionType):
        (inner,) = (a for a in arguments if a is not type(None))
        value = None if data is None else _read(inner, data, custom)
    elif origin is np.ndarray:
        value = np.array(_with_nan(data), dtype=typing.get_args(arguments[1])[0])
    elif origin is tuple:
        repeated = len(arguments) == 2 and arguments[1] is ...
        kinds = arguments[:1] * len(data) if repeated else arguments
        pairs = zip(kinds, data, strict=True)
        value = tuple(_read(argument, item, custom) for argument, item in pairs)
    elif kind in custom:
        value = custom[kind][1](data)
    elif isinstance(kind, type) and dataclasses.is_dataclass(kind):
        # An older file lacks what was added since: the field's default is what it meant.
        names = [f.name for f in dataclasses.fields(kind) if f.name in data or _required(f)]
        value = kind(**{n: _read(_hints(kind)[n], data[n], custom) for n in names})
    elif kind is float:
        value = math.nan if data is None else float(data)
    elif kind in (int, str, bool) and not isinstance(data, kind):
        raise TypeError(f"{data!r} is no {kind.__name__}")
    return value


def _required(field: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return field.default is missing and field.default_factory is missing


def _with_nan(value: Any) -> Any:
    if isinstance(value, list):
        return [_with_nan(item) for item in value]
    return math.nan if value is None else value
