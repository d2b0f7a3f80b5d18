"""Text for a terminal: tables, and prose that is wrapped where it is printed."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Sequence

WIDTH = 80
_COLUMNS = re.compile(r"(.*\S {2,}(?=\S))?( *)")
"""What stands before the last column of a line, columns being two spaces or more apart."""


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], left: Collection[int] = (0,)
) -> list[str]:
    """Lines of a table, columns two spaces apart, those in `left` to the left, others to the right.

    Where the table is wider than `WIDTH`, its heads are broken at spaces and hyphens.
    """
    body = [max((len(row[c]) for row in rows), default=0) for c in range(len(head))]
    heads = [[h] for h in head]
    if sum(max(len(h), w) + 2 for h, w in zip(head, body, strict=True)) - 2 > WIDTH:
        heads[1:] = [_broken(h, w) for h, w in zip(head[1:], body[1:], strict=True)]
    height = max(map(len, heads))
    lines = [[h[k - height] if height - k <= len(h) else "" for h in heads] for k in range(height)]
    cells = [*lines, *map(list, rows)]
    widths = [max(len(row[c]) for row in cells) for c in range(len(head))]
    return [
        "  ".join(
            cell.ljust(width) if c in left else cell.rjust(width)
            for c, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]


def _broken(head: str, width: int) -> list[str]:
    """A head in lines as wide as the column needs, or as its longest word."""
    longest = max((len(word) for word in re.split(r"(?<=-)| ", head)), default=0)
    return textwrap.wrap(head, max(width, longest, 1)) or [""]


def counted(number: int, thing: str) -> str:
    """As "1 rest", "2 rests"."""
    return f"{number} {thing}{'s' * (number != 1)}"


def wrapped(text: str, width: int) -> str:
    """`text` with each line of prose that is longer than `width` broken between words.

    The words go on below where they started: after the label, or the columns of a table, that are
    two spaces or more before them. A table whose last column starts in the right half is left as it
    is, and so is a word that is longer than the line.
    """
    return "\n".join(part for line in text.split("\n") for part in _wrapped_line(line, width))


def _wrapped_line(line: str, width: int) -> list[str]:
    before = _COLUMNS.match(line)
    start = before.end() if before else 0
    if len(line) <= width or start > width // 2:
        return [line]
    return textwrap.wrap(
        line[start:], width, initial_indent=line[:start], subsequent_indent=" " * start,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
