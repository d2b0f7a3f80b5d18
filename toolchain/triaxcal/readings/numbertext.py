"""A cell of text as a number: what is one, and what to do about one that almost is."""

from __future__ import annotations

import math
import re

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}([ _'’\u00a0\u202f,]\d{3})+(\.\d*)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf", "+inf", "#n/a",
                      "#value!", "#div/0!", "#num!", "#ref!", "#name?", "#null!"})  # fmt: skip
_TIME = re.compile(r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}([T ].*)?|\d{1,2}:\d\d:\d\d([.,]\d+)?)")


def is_number(text: str) -> bool:
    """Whether a cell is a finite decimal number."""
    return _NUMBER.fullmatch(text) is not None and math.isfinite(float(text))


def number_remedy(text: str) -> str:
    """What to do about a number that is written in another way; "" where it is none."""
    # "0,125" may be either: a comma before three digits is read as decimal when it leads with 0.
    if _DECIMAL_COMMA.fullmatch(text) and (
        not _GROUPED.fullmatch(text) or text.lstrip("+-")[0] == "0"
    ):
        return "write a decimal point for the decimal comma"
    if _GROUPED.fullmatch(text):
        return "leave out the thousands separator"
    if text.startswith("−"):
        return "write the minus sign as a hyphen"
    return ""


def number_of(cell: str, decimal: str) -> float:
    """Number of a cell; NaN where it is missing.

    Raises
    ------
    ValueError
        Where the cell is no number.
    """
    text = cell.strip().replace(",", ".") if decimal == "," else cell.strip()
    if is_number(text):
        return float(text)
    if text.lower() in _MISSING:
        return float("nan")
    raise ValueError(f"{cell!r} is no number")


def is_word(cell: str, decimal: str) -> bool:
    """Whether a cell is neither a number nor missing."""
    try:
        number_of(cell, decimal)
    except ValueError:
        return True
    return False


def remedy_of(cell: str) -> str:
    """What to do about a cell that is no number; "" where it is not known."""
    if _TIME.fullmatch(cell.strip()):
        return 'if these are times, time_unit = "iso"'
    return 'if the decimals have a comma, decimal = ","' if "," in cell else ""
