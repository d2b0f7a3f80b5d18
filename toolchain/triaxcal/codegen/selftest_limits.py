"""Limits of step R (docs/explanation/fixed-point.md) that images of the self-test meet and exceed.

Each is a few changed words of the unit's own image.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

from triaxcal.codegen.image_layout import (
    GAIN,
    ORIGIN,
    RATE_GAIN,
    RATE_MAX,
    RATE_MIN,
    RATE_WORDS,
    Layout,
    sum_of_floors,
)
from triaxcal.codegen.inverse_edges import inverse_edges
from triaxcal.codegen.rate_ties import rate_ties
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.fixedpoint.plan import Plan


@dataclass(frozen=True)
class Change:
    """`count` words of a file, from index `first`, get a value."""

    first: int
    value: int
    count: int = 1


_EACH = 2**29
"""Each of the coefficients above c_0, where all of them decide."""

Limit = tuple[str, list[Change]]
"""A name and what is changed."""


class Limits:
    """Limits of a plan, whose image has these words."""

    def __init__(self, plan: Plan, layout: Layout, words: list[int]) -> None:
        self.plan = plan
        self.layout = layout
        self.words = words
        self.nil = 4 * (layout.order + 1)

    def all(self) -> Iterator[Limit]:
        """Every limit; the most useful ones first."""
        yield from self._temperatures()
        yield from self._coefficients()
        yield from self._rows()
        yield from self._terms()
        yield from self._rates()
        yield from self._inverses()

    def _temperatures(self) -> Iterator[Limit]:
        layout, words = self.layout, self.words
        reaches = layout.reaches(words)
        low, high = words[layout.temp_min], words[layout.temp_max]
        yield "temp_min_code", [Change(layout.temp_min, low + 1)]
        at, first, last = reaches[-1]
        yield "no codes", [Change(layout.temp_max, first - 1)]
        yield "one code", [Change(layout.temp_max, first)]
        yield "gain 0", [Change(at + GAIN, 0)]
        for beyond in (0, 1):
            origins = last - INT32_MAX - beyond, first + INT32_MAX + beyond
            for origin in origins:
                if INT32_MIN <= origin <= INT32_MAX:
                    yield f"origin {origin}", [Change(at + ORIGIN, origin), Change(at + GAIN, 1)]
        fullest = INT32_MAX // max(1, last - first)
        for origin, gain in itertools.product((first, last), (fullest, fullest + 1)):
            yield f"gain {gain}", [Change(at + ORIGIN, origin), Change(at + GAIN, gain)]
        for s, (at, _, _) in list(enumerate(reaches))[1:][-1:]:
            before = reaches[s - 1][0]
            gains = [Change(at + GAIN, 1), Change(before + GAIN, 1)]
            start = low if s == 1 else reaches[s - 1][1]
            for first in (start, start + 1, high, high + 1):
                yield f"first_code {first}", [Change(at, first), *gains]

    def _coefficients(self) -> Iterator[Limit]:
        """A function at its bound and one beyond, by one coefficient or by all of them."""
        layout, order = self.layout, self.layout.order
        s = layout.segments - 1
        for f, k, sign in ((0, 0, 1), (6, min(1, order), -1), (11, 0, -1)):
            room = INT32_MAX - _floors_above(order, k)
            for value in (room, room + 1)[k:]:
                yield (
                    f"c_{k} of function {f}",
                    [
                        Change(layout.coefficient(s, f - f % 4, 0), 0, self.nil),
                        Change(layout.coefficient(s, f, k), sign * value),
                    ],
                )
        if order:
            above = 0
            for k in range(order, 0, -1):
                above = _EACH + (0 if k == order else above // 2 + 1)
            for value in (INT32_MAX - 1 - above // 2, INT32_MAX - above // 2):
                yield (
                    f"c_0 of function 9 beneath others {value}",
                    [
                        Change(layout.coefficient(s, 8, 0), 0, self.nil),
                        Change(layout.coefficient(s, 9, 1), _EACH, order),
                        Change(layout.coefficient(s, 9, 0), -value),
                    ],
                )
        yield "INT32_MIN", [Change(layout.coefficient(s, 5, order), INT32_MIN)]

    def _rows(self) -> Iterator[Limit]:
        """Rows just below their limit and at it: a gain, and what is left as the offset."""
        layout = self.layout
        if layout.inverse:
            return
        floors = sum_of_floors(layout.order)
        # With dT/dt an image of that term has row 1 at its limit.
        rows = (0, 2) if layout.rate else range(3)
        for row, excess in itertools.product(rows, (-1, 0)):
            left = layout.row_limit + excess - 5 * floors
            if layout.rate:
                left -= 2 * (abs(self.words[layout.rate_word(RATE_WORDS + row)]) // 2 + 1)
            offset = left // 2 - 2**29
            s = row % layout.segments
            yield (
                f"row {row} at its limit {excess:+d}",
                [
                    Change(layout.coefficient(s, 4 * row, 0), 0, self.nil),
                    Change(layout.coefficient(s, 4 * row + row, 0), left - 2 * offset),
                    Change(layout.coefficient(s, 4 * row + 3, 0), -offset),
                ],
            )

    def _terms(self) -> Iterator[Limit]:
        layout = self.layout
        if not layout.columns:
            return
        share = layout.limit // layout.columns
        for row, excess in ((0, 1), (2, 0), (2, 1)):
            last = layout.limit + excess - (layout.columns - 1) * share
            yield (
                f"terms of row {row} at their limit {excess:+d}",
                [
                    Change(layout.term(row, 0), share, layout.columns),
                    Change(layout.term(row, layout.columns - 1 if excess else 0), -last),
                ],
            )

    def _rates(self) -> Iterator[Limit]:
        layout = self.layout
        if not layout.rate:
            return
        low, high, gain = (layout.rate_word(k) for k in (RATE_MIN, RATE_MAX, RATE_GAIN))
        for at, value in ((low, 0), (low, 1), (high, 0), (high, -1), (gain, 0)):
            yield f"word {at} of the rate {value}", [Change(at, value)]
        for name, words in itertools.islice(rate_ties(layout, self.plan.shape), 0, 4, 2):
            yield name, _runs(words)
        left = (layout.row_limit - 1 - 5 * sum_of_floors(layout.order) - 2**31) // 2
        for offset in (left, left + 1):
            yield (
                f"rate and offset {offset}",
                [
                    Change(layout.coefficient(0, 4, 0), 0, self.nil),
                    Change(layout.coefficient(0, 7, 0), offset),
                    Change(layout.rate_word(RATE_WORDS + 1), 2**31 - 2),
                ],
            )
        for first, last in ((INT32_MIN, 0), (0, INT32_MAX), (-INT32_MAX, 0)):
            changes = [Change(low, first), Change(high, last), Change(gain, 1)]
            yield f"rates {first} to {last}", changes

    def _inverses(self) -> Iterator[Limit]:
        shape, layout = self.plan.shape, self.layout
        if shape.inverse is None:
            return
        largest = INT32_MAX - sum_of_floors(layout.order)
        edges = inverse_edges(shape.inverse, largest, shape.rounding_in_offset, layout.row_limit)
        # Sums of rows first: only they show what is done where K has no usable inverse.
        for name, k00, k01, u0, k10 in sorted(edges, key=lambda edge: edge[0][:3] != "row"):
            constant = {0: k00, 1: k01, 3: u0, 4: k10, 5: largest, 10: largest}
            yield (
                name,
                [
                    Change(layout.coefficient(0, 0, 0), 0, 3 * self.nil),
                    *(Change(layout.coefficient(0, f, 0), v) for f, v in constant.items() if v),
                ],
            )


def _floors_above(order: int, k: int) -> int:
    """What Horner's rule adds to c_k when all others are nil."""
    above = 0
    for higher in range(order, k, -1):
        above = 0 if higher == order else above // 2 + 1
    return 0 if k == order else above // 2 + 1


def _runs(words: dict[int, int]) -> list[Change]:
    """Changes of single words, neighbours of one value taken together."""
    found: list[Change] = []
    for at, value in sorted(words.items()):
        last = found[-1] if found else None
        if last is not None and (last.first + last.count, last.value) == (at, value):
            found[-1] = replace(last, count=last.count + 1)
        else:
            found.append(Change(at, value))
    return found
