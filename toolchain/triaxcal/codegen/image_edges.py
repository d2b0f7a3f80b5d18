"""Changed words that take an image to every limit of step R and just beyond, and wild ones.

docs/explanation/fixed-point.md has step R. Whether an image may be accepted is not decided here.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from random import Random

from triaxcal.codegen.image_layout import (
    GAIN,
    INT32_MAX,
    INT32_MIN,
    ORIGIN,
    RATE_WORDS,
    Layout,
    sum_of_floors,
)
from triaxcal.codegen.inverse_edges import inverse_edges
from triaxcal.codegen.rate_ties import rate_edges, rate_ties
from triaxcal.fixedpoint.shape import Shape

SEED = 20130527
WILD_IMAGES = 48

Change = tuple[str, dict[int, int]]
"""A name, and words by index."""


def image_edges(layout: Layout, words: list[int], shape: Shape) -> Iterator[Change]:
    """Every change of an image of these words."""
    yield from _temperature_edges(layout, words)
    yield from _coefficient_edges(layout, words)
    yield from _row_edges(layout, words)
    yield from _wild(layout, words)
    yield from _inverse_edges(layout, shape)
    yield from _term_edges(layout)
    yield from rate_edges(layout, words)
    yield from rate_ties(layout, shape)


def _temperature_edges(layout: Layout, words: list[int]) -> Iterator[Change]:
    low, high = words[layout.temp_min], words[layout.temp_max]
    starts = [layout.segment(s) for s in range(layout.segments)]
    for value in (low - 1, low + 1):
        yield "temp_min_code", {layout.temp_min: value}
        yield "first_code", {starts[0]: value}
    last_origin, last_gain = words[starts[-1] + ORIGIN], words[starts[-1] + GAIN]
    reach = INT32_MAX // last_gain
    for value in (last_origin + reach, last_origin + reach + 1, low, low - 1, INT32_MAX, INT32_MIN):
        yield f"temp_max_code {value}", {layout.temp_max: value}
    reach = INT32_MAX // words[starts[0] + GAIN]
    for beyond in (0, 1):
        value = words[starts[0] + ORIGIN] - reach - beyond
        yield f"temp_min_code {value}", {layout.temp_min: value, starts[0]: value}
    firsts = [words[at] for at in starts]
    lasts = [f - 1 for f in firsts[1:]] + [high]
    for s, at in enumerate(starts):
        fullest = _fullest_gain(layout, words, s)
        for gain in (INT32_MIN, -1, 0, 1, fullest, fullest + 1, INT32_MAX):
            yield f"gain {gain} of segment {s}", {at + GAIN: gain}
        for origin in (INT32_MIN, INT32_MAX, firsts[s], lasts[s]):
            yield f"origin {origin} of segment {s}", {at + ORIGIN: origin}
        for beyond in (0, 1):
            # INT32_MAX is prime: only a gain of 1 reaches it exactly.
            origin = lasts[s] - INT32_MAX - beyond
            yield f"origin {origin} of segment {s}", {at + ORIGIN: origin, at + GAIN: 1}
        if s:
            # The segment before ends where its x does, or one code later.
            before = starts[s - 1]
            end = words[before + ORIGIN] + INT32_MAX // words[before + GAIN]
            for first in (end + 1, end + 2):
                yield f"first_code {first} of segment {s}, near", {at: first, at + GAIN: 1}
            # The order of the segments, with gains that any reach allows.
            for first in (INT32_MIN, low, low + 1, firsts[s - 1], high, high + 1, INT32_MAX):
                yield f"first_code {first} of segment {s}", {
                    at: first, at + GAIN: 1, starts[s - 1] + GAIN: 1
                }  # fmt: skip


def _coefficient_edges(layout: Layout, words: list[int]) -> Iterator[Change]:
    """Every stage of Horner's rule at the largest bound that fits, and one beyond."""
    for s, f, k, here in layout.coefficients(range(12)):
        above = 0
        for higher in range(layout.order, k, -1):
            halved = 0 if higher == layout.order else above // 2 + 1
            above = abs(words[layout.coefficient(s, f, higher)]) + halved
        room = INT32_MAX - (0 if k == layout.order else above // 2 + 1)
        others = {layout.coefficient(s, f, lower): 0 for lower in range(k)}
        # The rest of the row is nil, so that only this function decides.
        for g in range(4 * (f // 4), 4 * (f // 4) + 4):
            if g != f:
                others |= {layout.coefficient(s, g, n): 0 for n in range(layout.order + 1)}
        for value in (room, room + 1, -room, -room - 1):
            yield f"c_{k} = {value}, function {f}, segment {s}", {**others, here: value}
    at = layout.coefficient(0, 0, 0)
    yield "INT32_MIN", {at: INT32_MIN}


def _row_edges(layout: Layout, words: list[int]) -> Iterator[Change]:
    """Rows whose sum is just below the limit and at it, each function in turn deciding."""
    floors = sum_of_floors(layout.order)
    for s, row, last in itertools.product(range(layout.segments), range(3), range(4)):
        for excess in (-1, 0):
            left = layout.row_limit + excess
            weights = [1, 1, 1, 2]
            change = {
                layout.coefficient(s, 4 * row + j, k): 0
                for j in range(4)
                for k in range(layout.order + 1)
            }
            left -= sum(w * floors for w in weights)
            if layout.rate:
                left -= 2 * (abs(words[layout.rate_word(RATE_WORDS + row)]) // 2 + 1)
            order = [j for j in range(4) if j != last] + [last]
            for j in order:
                most = INT32_MAX - floors
                share = min(most, left // weights[j]) if j == last else min(most, left // 4)
                change[layout.coefficient(s, 4 * row + j, 0)] = share if j % 2 else -share
                left -= weights[j] * share
            # What the last cannot take (it is too much, or odd) goes to the first gain.
            first = layout.coefficient(s, 4 * row + (0 if last else 1), 0)
            change[first] += left if change[first] > 0 else -left
            yield f"row {row} at {layout.row_limit + excess}, segment {s}", change


def _fullest_gain(layout: Layout, words: list[int], s: int) -> int:
    """The largest gain of a segment for which its x fits int32."""
    at, first, last = layout.reaches(words)[s]
    return INT32_MAX // max(1, words[at + ORIGIN] - first, last - words[at + ORIGIN])


def _wild(layout: Layout, words: list[int]) -> Iterator[Change]:
    """Random constants of all sizes: nearly singular K, saturating inverses, full rows.

    Every other image has the largest gains that fit, which fill both halves of x.
    """
    rng = Random(SEED)
    gains = {
        layout.segment(s) + GAIN: _fullest_gain(layout, words, s) for s in range(layout.segments)
    }
    for number in range(WILD_IMAGES):
        size = 1 << rng.randrange(1, 31)
        change = gains.copy() if number % 2 else {}
        for _, _, k, at in layout.coefficients(range(12)):
            limit = max(1, (size if rng.random() < 0.8 else 2) >> (k + 1))
            change[at] = rng.randint(-limit, limit)
        if number % 4 == 0 and layout.inverse:
            # Two equal rows of K: a determinant of nothing but rounding.
            for s, j, k, at in layout.coefficients(range(3)):
                change[layout.coefficient(s, 4 + j, k)] = change[at]
        for row, k in itertools.product(range(3), range(layout.columns)):
            # As many of equal shares keep step R; every eighth image may break it.
            limit = layout.limit // (2 if number % 8 == 0 else layout.columns)
            change[layout.term(row, k)] = rng.randint(-limit, limit)
        for k in range(3 if layout.rate else 0):
            change[layout.rate_word(RATE_WORDS + k)] = rng.randint(-size // 2, size // 2)
        yield f"wild {number}", change


def _inverse_edges(layout: Layout, shape: Shape) -> Iterator[Change]:
    if shape.inverse is None:
        return
    largest = INT32_MAX - sum_of_floors(layout.order)
    for name, k00, k01, u0, k10 in inverse_edges(
        shape.inverse, largest, shape.rounding_in_offset, layout.row_limit
    ):
        constant = {0: k00, 1: k01, 3: u0, 4: k10, 5: largest, 10: largest}
        every = layout.coefficients(range(12))
        yield name, {at: 0 if n else constant.get(f, 0) for _, f, n, at in every}


def _term_edges(layout: Layout) -> Iterator[Change]:
    """Rows of terms at their limit and one beyond, each word in turn deciding."""
    for row, last in itertools.product(range(3), range(layout.columns)):
        for excess in (0, 1):
            share = layout.limit // layout.columns
            change = {
                layout.term(row, k): share if k % 2 else -share for k in range(layout.columns)
            }
            most = layout.limit + excess - (layout.columns - 1) * share
            change[layout.term(row, last)] = most if row % 2 else -most
            yield f"terms of row {row} at {layout.limit + excess}, word {last}", change
        alone = {layout.term(row, k): 0 for k in range(layout.columns)}
        for value in (layout.limit, -layout.limit, INT32_MIN, INT32_MAX):
            yield f"term {row}, {last} = {value}", {**alone, layout.term(row, last): value}
