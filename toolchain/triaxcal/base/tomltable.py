"""TOML files, and their values in messages.

Decimal numbers are kept as `decimal.Decimal` until a kind turns them into floats, so that a table
of printed numbers can also be had exactly.
"""

from __future__ import annotations

import datetime
import difflib
import re
import tomllib
from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path

from triaxcal.base.errors import RefusedError

_DECIMAL_COMMA = re.compile(r"[^#\"\'=\[]*=\s*[-+]?\d+,\d")


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
    return toml_document(str(path), content_of(path))


def has_table(path: Path, name: str) -> bool:
    """Whether the top level of a TOML file has the key `name`, a word.

    Raises
    ------
    RefusedError
        As `read_toml`; a file without the letters of `name` is not parsed.
    """
    # Most files have none of the tables that are asked for: a thousand parses are saved.
    content = content_of(path)
    return name.encode() in content and name in toml_document(str(path), content)


def text_of(content: bytes) -> str:
    """Text of the content of a file that has been read as UTF-8, without a byte order mark."""
    return content.decode("utf-8-sig")


def content_of(path: Path) -> bytes:
    """Content of a file.

    Raises
    ------
    RefusedError
        When it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise RefusedError(str(path), f"cannot be read: {error.strerror}") from error


def toml_document(where: str, content: bytes) -> dict[str, object]:
    """Document of the content of a TOML file, decimals as `Decimal`; `where` is for messages.

    Raises
    ------
    RefusedError
        When it is not UTF-8, or not TOML.
    """
    try:
        # utf-8-sig: editors that write a byte order mark are common, and it is harmless.
        text = text_of(content)
    except UnicodeDecodeError as error:
        raise RefusedError(
            where, f"byte {error.start} is not UTF-8", remedy="save the file as UTF-8"
        ) from error
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except (ValueError, ArithmeticError, RecursionError) as error:
        at = re.search(r"at line (\d+)", str(error))
        comma = at and _DECIMAL_COMMA.match(text.splitlines()[int(at[1]) - 1])
        remedy = "write a decimal point for the decimal comma" if comma else ""
        raise RefusedError(where, f"not TOML: {error}", remedy=remedy) from error


def key_name(table: str, key: str) -> str:
    """A key as messages name it, as "[adc] bits", "[[equipment]] number 2, due"."""
    shown_key = key if key.isprintable() and len(key) <= 40 else ascii(key)[:40]
    name, _, number = table.partition("#")
    if number:
        return f"[[{name}]] number {number}, {shown_key}"
    return f"[{table}] {shown_key}" if table else shown_key
