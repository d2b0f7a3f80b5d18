"""A table as CSV within a page: a link that a browser saves as a file."""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Iterable, Sequence


def csv_link(rows: Iterable[Sequence[object]]) -> str:
    """Address that has the rows in it; names of columns come first, with their units."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(_safe(row) for row in rows)
    coded = base64.b64encode(text.getvalue().encode("utf-8", "backslashreplace")).decode()
    return f"data:text/csv;charset=utf-8;base64,{coded}"


def _safe(row: Sequence[object]) -> list[object]:
    """Text that a spreadsheet would take for a formula gets an apostrophe."""
    return [f"'{v}" if isinstance(v, str) and v[:1] in "=+-@\t\r" and v[1:] else v for v in row]
