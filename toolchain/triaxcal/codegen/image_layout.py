"""Where the words of an image stand, and what the loader must accept: step R.

Decided from docs/explanation/fixed-point.md in Python's unbounded integers, not by the code that
plans or proves.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1


ROW_LIMIT, ROW_LIMIT_WITH_TERMS = 2**32 - 8, 3 * 2**30


RATE_MIN, RATE_MAX, RATE_GAIN, RATE_WORDS = range(4)
"""Columns and limit of a row of the table of terms."""


FIRST, ORIGIN, GAIN, COEFFICIENTS = range(4)


def sum_of_floors(order: int) -> int:
    """B_0 of a function whose coefficients are all nil."""
    bound = 0
    for _ in range(order):
        bound = bound // 2 + 1
    return bound


@dataclass(frozen=True)
class Layout:
    """Where the words of an image of one shape stand, and step R for them."""

    header: int
    segments: int
    order: int
    inverse: bool
    columns: int = 0
    limit: int = 0
    rate: bool = False

    @property
    def temp_min(self) -> int:
        """Index of temp_min_code."""
        return self.header

    @property
    def temp_max(self) -> int:
        """Index of temp_max_code."""
        return self.header + 1

    @property
    def row_limit(self) -> int:
        """Limit of a row."""
        return ROW_LIMIT_WITH_TERMS if self.columns else ROW_LIMIT

    def segment(self, s: int) -> int:
        """Index of the first word of a segment."""
        return self.header + 2 + s * (COEFFICIENTS + 12 * (self.order + 1))

    def term(self, row: int, k: int) -> int:
        """Index of a word of the table of terms."""
        return self.segment(self.segments) + self.columns * row + k

    def coefficient(self, s: int, f: int, k: int) -> int:
        """Index of c_k of a function."""
        return self.segment(s) + COEFFICIENTS + f * (self.order + 1) + k

    def coefficients(self, functions: Iterable[int]) -> list[tuple[int, int, int, int]]:
        """Segment, function, power and index of every coefficient of some functions."""
        places = itertools.product(range(self.segments), functions, range(self.order + 1))
        return [(s, f, k, self.coefficient(s, f, k)) for s, f, k in places]

    def reaches(self, words: list[int]) -> list[tuple[int, int, int]]:
        """First word of each segment, and its first and last temperature code."""
        starts = [self.segment(s) for s in range(self.segments)]
        firsts = [words[at] for at in starts]
        lasts = [f - 1 for f in firsts[1:]] + [words[self.temp_max]]
        return list(zip(starts, firsts, lasts, strict=True))

    def is_safe(self, words: list[int]) -> bool:
        """Step R: whether no arithmetic can overflow with these constants."""
        low, high = words[self.temp_min], words[self.temp_max]
        _, firsts, lasts = zip(*self.reaches(words), strict=True)
        if firsts[0] != low or any(not low < f <= high for f in firsts[1:]):
            return False
        if self.rate and not self._rate_is_safe(words):
            return False
        for row in range(3):
            if sum(abs(words[self.term(row, k)]) for k in range(self.columns)) > self.limit:
                return False
        return all(self._segment_is_safe(words, s, lasts[s]) for s in range(self.segments))

    def rate_word(self, k: int) -> int:
        """Index of a word of the term in dT/dt."""
        return self.segment(self.segments) + 3 * self.columns + k

    def _rate_is_safe(self, words: list[int]) -> bool:
        low, high, gain = (words[self.rate_word(k)] for k in (RATE_MIN, RATE_MAX, RATE_GAIN))
        return low <= 0 <= high and gain > 0 and max(-low, high) * gain <= INT32_MAX

    def _segment_is_safe(self, words: list[int], s: int, last: int) -> bool:
        at = self.segment(s)
        first, origin, gain = words[at : at + 3]
        if gain <= 0 or first > last:
            return False
        if max(abs(first - origin), abs(last - origin)) * gain > INT32_MAX:
            return False
        ends = []
        for f in range(12):
            bound = 0
            for k in range(self.order, -1, -1):
                halved = 0 if k == self.order else bound // 2 + 1
                bound = abs(words[self.coefficient(s, f, k)]) + halved
                if bound > INT32_MAX:
                    return False
            ends.append(bound)
        if self.rate:
            for i in range(3):
                ends[4 * i + 3] += abs(words[self.rate_word(RATE_WORDS + i)]) // 2 + 1
        rows = [sum(ends[4 * i : 4 * i + 3]) + 2 * ends[4 * i + 3] for i in range(3)]
        return self.inverse or max(rows) < self.row_limit
