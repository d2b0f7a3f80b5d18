"""A cell of text as a number: what is one, and what to do about one that almost is."""

from __future__ import annotations

import math
import re

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}([ _'’\u00a0\u202f,]\d{3})+(\.\d*)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)


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
