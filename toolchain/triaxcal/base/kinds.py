"""Kinds of values in TOML files: type and range, each for the reader, the reference, the schema."""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from typing import Any, Generic, TypeVar

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True)
class Kind(Generic[T_co]):
    """Type and range of a value.

    Attributes
    ----------
    expected : str
        Both in words, for messages and the reference: "a whole number from 0 to 9".
    parse : callable
        Gives the value of what TOML holds; `ValueError` where it is not as expected.
    schema : mapping
        JSON Schema of the value.
    remedy : str
        What to do about a wrong one.
    choices : tuple of str
        Words that it may be, to hint at a near miss.
    example : str
        A good value in TOML.
    """

    expected: str
    parse: Callable[[Any], T_co]
    schema: Mapping[str, Any]
    remedy: str = ""
    choices: tuple[str, ...] = ()
    example: str = ""


class WrongItemError(ValueError):
    """An item of a list is none of a few words."""

    def __init__(self, item: object, kind: Kind[Any]) -> None:
        self.item, self.kind = item, kind
        super().__init__()


def checked(
    good: Callable[[Any], bool],
    expected: str,
    schema: Mapping[str, Any],
    example: str,
    remedy: str = "",
) -> Kind[Any]:
    """Kind whose values are as they stand in the file."""

    def parse(value: Any) -> Any:
        if not good(value):
            raise ValueError
        return value

    return Kind(expected, parse, schema, remedy, example=example)


TEXT: Kind[str] = checked(
    lambda v: isinstance(v, str), "text in quotes", {"type": "string"}, '"name"'
)
FLAG: Kind[bool] = checked(
    lambda v: isinstance(v, bool), "true or false", {"type": "boolean"}, "true"
)
DATE: Kind[datetime.date] = checked(
    lambda v: isinstance(v, datetime.date) and not isinstance(v, datetime.datetime),
    "a day without quotes, as 2026-03-30",
    {"type": "string", "format": "date"},
    "2026-03-30",
)


def line(longest: int | None = None) -> Kind[str]:
    """One printable line of text; its white space is folded."""

    def parse(value: Any) -> str:
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise ValueError
        if longest is not None and len(value) > longest:
            raise ValueError
        return " ".join(value.split())

    size = {"minLength": 1} | ({"maxLength": longest} if longest else {})
    limit = f" of 1 to {longest} characters" if longest else ""
    return Kind(f"one line of text{limit}", parse, {"type": "string", **size}, example='"name"')


def pattern(regex: str, expected: str, example: str) -> Kind[str]:
    """Text that matches a regular expression whole, letters and digits of ASCII."""
    wanted = re.compile(regex, re.ASCII)
    return checked(
        lambda v: isinstance(v, str) and wanted.fullmatch(v) is not None,
        expected,
        {"type": "string", "pattern": f"^(?:{regex})$"},
        example,
    )


def word(choices: Sequence[str]) -> Kind[str]:
    """One of a few words."""
    return meaning({choice: choice for choice in choices})


def meaning(words: Mapping[str, T]) -> Kind[T]:
    """One of a few words; the value is what it stands for."""

    def parse(value: Any) -> T:
        if not isinstance(value, str) or value not in words:
            raise ValueError
        return words[value]

    expected = "one of " + ", ".join(f'"{choice}"' for choice in words)
    names = tuple(words)
    return Kind(expected, parse, {"enum": list(names)}, "", names, f'"{names[0]}"')


def whole(low: int, high: int) -> Kind[int]:
    """A whole number from `low` to `high`."""
    return checked(
        lambda v: isinstance(v, int) and not isinstance(v, bool) and low <= v <= high,
        f"a whole number from {low} to {high}" if low < high else f"{low}",
        {"type": "integer", "minimum": low, "maximum": high},
        f"{low}",
    )


def decimal(low: float = -math.inf, high: float = math.inf) -> Kind[Decimal]:
    """A finite number from `low` to `high`, exactly as written."""

    def parse(value: Any) -> Decimal:
        if isinstance(value, bool) or not isinstance(value, int | Decimal):
            raise ValueError
        exact = Decimal(value)  # huge ones are infinite as floats
        if not math.isfinite(exact) or not low <= float(exact) <= high:
            raise ValueError
        return exact

    schema: dict[str, Any] = {"type": "number"}
    if math.isfinite(low):
        schema |= {"minimum": low, "maximum": high}
    return Kind(f"a number from {low:g} to {high:g}", parse, schema, example=f"{low:g}")


def number(low: float = -math.inf, high: float = math.inf) -> Kind[float]:
    """A finite number from `low` to `high`."""
    exact = decimal(low, high)
    return Kind(exact.expected, lambda v: float(exact.parse(v)), exact.schema, "", (), f"{low:g}")


def listed(
    item: Kind[T], lengths: range, expected: str, *, different: bool = False, remedy: str = ""
) -> Kind[tuple[T, ...]]:
    """A list of values of a kind; `lengths` are the legal lengths; `different` allows no twins."""

    def parse(value: Any) -> tuple[T, ...]:
        if not isinstance(value, list) or len(value) not in lengths:
            raise ValueError
        for v in value:
            if item.choices and v not in item.choices:
                raise WrongItemError(v, item)
        items = tuple(item.parse(v) for v in value)
        if different and len(set(items)) != len(items):
            raise ValueError
        return items

    schema = {
        "type": "array",
        "items": item.schema,
        "minItems": lengths[0],
        "maxItems": lengths[-1],
        "uniqueItems": different,
    }
    example = ", ".join([item.example] * max(1, lengths[0]))
    return Kind(expected, parse, schema, remedy, example=f"[{example}]")


def rising(low: float, high: float, shortest: int, longest: int) -> Kind[tuple[float, ...]]:
    """A list of rising numbers from `low` to `high`, `shortest` to `longest` of them."""
    size = f"{shortest}" if longest == shortest else f"{shortest} to {longest}"
    expected = f"a list of {size} rising numbers from {low:g} to {high:g}"
    numbers = listed(number(low, high), range(shortest, longest + 1), expected)

    def parse(value: Any) -> tuple[float, ...]:
        items = numbers.parse(value)
        if not all(a < b for a, b in pairwise(items)):
            raise ValueError
        return items

    example = ", ".join(f"{low + i:g}" for i in range(max(1, shortest)))
    return Kind(expected, parse, numbers.schema, example=f"[{example}]")


def interval(low: float, high: float) -> Kind[tuple[float, float]]:
    """Two rising numbers from `low` to `high`."""
    two = rising(low, high, 2, 2)

    def parse(value: Any) -> tuple[float, float]:
        first, last = two.parse(value)
        return first, last

    return Kind(two.expected, parse, two.schema, example=two.example)


def span(low: float, high: float) -> Kind[tuple[float, float]]:
    """Lowest and highest of a quantity, from `low` to `high`; both may be equal."""
    expected = f"a list of lowest and highest, numbers from {low:g} to {high:g}"
    numbers = listed(number(low, high), range(2, 3), expected)

    def parse(value: Any) -> tuple[float, float]:
        first, last = numbers.parse(value)
        if last < first:
            raise ValueError
        return first, last

    return Kind(expected, parse, numbers.schema, example=f"[{low:g}, {high:g}]")


def three(
    item: Kind[T], expected: str, good: Callable[[T], bool] = lambda _: True
) -> Kind[tuple[T, T, T]]:
    """Three values of a kind that are all `good`."""
    items = listed(item, range(3, 4), expected)

    def parse(value: Any) -> tuple[T, T, T]:
        x, y, z = items.parse(value)
        if not (good(x) and good(y) and good(z)):
            raise ValueError
        return x, y, z

    return Kind(expected, parse, items.schema, example=items.example)
