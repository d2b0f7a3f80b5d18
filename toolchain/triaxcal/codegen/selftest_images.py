"""Images of the self-test: what the loader on the device must take, and what it must refuse.

The device makes each from its own constants and a few changed words: at a limit of step R and one
beyond (docs/explanation/fixed-point.md), of another shape, damaged, with and without an identity.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.codegen.identity import IDENTITY_SIZE, MAGIC, VERSION
from triaxcal.codegen.image import header_words, image_bytes
from triaxcal.codegen.image_cases import layout_of
from triaxcal.codegen.image_layout import (
    COEFFICIENTS,
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
from triaxcal.codegen.selftest_vectors import Vectors, answers_of
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.fixedpoint.plan import Plan

IDENTITY_WORDS = IDENTITY_SIZE // 4


@dataclass(frozen=True)
class Change:
    """`count` words of a file, from index `first`, get a value."""

    first: int
    value: int
    count: int = 1


@dataclass(frozen=True)
class SelftestImage:
    """An image of `size` bytes, and the CRC-32 of all answers with it; 0 where it is refused."""

    name: str
    size: int
    changes: tuple[Change, ...]
    answers: int = 0


ENTRY_SIZE = 8
"""Bytes of flash of an image, and of each change."""


def selftest_images(plan: Plan, vectors: Vectors, size: int) -> list[SelftestImage]:
    """The images of a plan, in an order of use: as many as fit `size` bytes of flash."""
    chosen: list[SelftestImage] = []
    maker = _Maker(plan)
    for image in maker.images():
        if any(not INT32_MIN <= c.value <= INT32_MAX for c in image.changes):
            continue  # beyond what a word holds: this plan has no such limit
        size -= ENTRY_SIZE * (1 + len(image.changes))
        if size < 0:
            break
        words = maker.file(image.changes)
        if maker.is_taken(words, image.size):
            digest = _digest(_changed_plan(plan, maker.layout, words), vectors)
            chosen.append(replace(image, answers=digest))
        else:
            chosen.append(image)
    return chosen


def _digest(plan: Plan, vectors: Vectors) -> int:
    results, status = answers_of(plan, vectors)
    digest = zlib.crc32(np.column_stack([results, status]).astype("<i4").tobytes())
    assert digest != 0  # means refused
    return digest


def _changed_plan(plan: Plan, layout: Layout, words: list[int]) -> Plan:
    """The plan with the constants of an image."""
    segments = []
    for s, segment in enumerate(plan.segments):
        at = layout.segment(s)
        first, origin, gain = words[at : at + COEFFICIENTS]
        table = words[at + COEFFICIENTS : at + COEFFICIENTS + segment.coefficients.size]
        coefficients = np.array(table, np.int64).reshape(segment.coefficients.shape)
        segments.append(replace(
            segment, first_code=first, origin_code=origin, gain=gain, coefficients=coefficients
        ))  # fmt: skip
    at = layout.term(0, 0)
    terms = np.array(words[at : at + 3 * layout.columns], np.int64).reshape(3, -1)
    rate = plan.rate
    if rate is not None:
        at = layout.rate_word(0)
        low, high, gain, *numbers = words[at : at + RATE_WORDS + 3]
        rate = replace(
            rate, min_code=low, max_code=high, gain=gain, words=np.array(numbers, np.int64)
        )
    return replace(
        plan,
        temp_min_code=words[layout.temp_min],
        temp_max_code=words[layout.temp_max],
        segments=tuple(segments),
        quadratic=None if plan.quadratic is None else terms,
        sensitivity=None if plan.sensitivity is None else terms,
        rate=rate,
    )


def _crc(words: list[int]) -> int:
    return _signed(zlib.crc32(np.array(words, np.int64).astype("<i4").tobytes()))


def _signed(word: int) -> int:
    return (word + 2**31) % 2**32 - 2**31


class _Maker:
    """Images of a plan."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.layout = layout_of(plan)
        self.words: list[int] = np.frombuffer(image_bytes(plan), "<i4").tolist()
        self.length = len(self.words)
        self.nil = 4 * (plan.shape.order + 1)

    def file(self, changes: tuple[Change, ...]) -> list[int]:
        """Words of the whole file; changes before a CRC is made, and again after it."""
        words = [*self.words[:-1], 0, _signed(MAGIC), VERSION]
        words += [0] * (self.length + IDENTITY_WORDS - len(words))

        def change() -> None:
            for c in changes:
                words[c.first : c.first + c.count] = [c.value] * c.count

        change()
        words[self.length - 1] = words[self.length + 2] = _crc(words[: self.length - 1])
        change()
        words[-1] = _crc(words[:-1])
        change()
        return words

    def is_taken(self, words: list[int], size: int) -> bool:
        """Whether the loader must take the first `size` bytes."""
        if size not in (4 * self.length, 4 * len(words)):
            return False
        header = [_signed(w) for w in header_words(self.plan)]
        if words[: len(header)] != header or not self._crc_fits(words[: self.length]):
            return False
        if size == 4 * len(words):
            identity = words[self.length : self.length + 3]
            if identity != [_signed(MAGIC), VERSION, words[self.length - 1]]:
                return False
            if not self._crc_fits(words):
                return False
        return self.layout.is_safe(words[: self.length - 1])

    def _crc_fits(self, words: list[int]) -> bool:
        return words[-1] == _crc(words[:-1])

    def images(self) -> Iterator[SelftestImage]:
        """All of them; the most useful ones first."""
        short = 4 * self.length
        long = short + IDENTITY_SIZE
        yield SelftestImage("constants", short, ())
        yield SelftestImage("with identity", long, ())
        yield from self._damaged(short, long)
        limits = itertools.chain(
            self._temperatures(), self._coefficients(), self._rows(), self._terms(),
            self._rates(), self._inverses(),
        )  # fmt: skip
        for name, changes in limits:
            yield SelftestImage(name, short, tuple(changes))

    def _damaged(self, short: int, long: int) -> Iterator[SelftestImage]:
        header = self.layout.header
        for name, size, at in (
            ("first word", short, 0),
            ("last word of the shape", short, header - 1),
            ("CRC", short, self.length - 1),
            ("identity's magic", long, self.length),
            ("identity's version", long, self.length + 1),
            ("identity of others", long, self.length + 2),
            ("CRC of the file", long, self.length + IDENTITY_WORDS - 1),
        ):
            value = self.file(())[at] ^ 1
            yield SelftestImage(name, size, (Change(at, value),))
        yield SelftestImage("4 bytes more", short + 4, ())

    def _temperatures(self) -> Iterator[tuple[str, list[Change]]]:
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

    def _coefficients(self) -> Iterator[tuple[str, list[Change]]]:
        """A function at its bound and one beyond; the rest of its row is nil."""
        layout, order = self.layout, self.layout.order
        s = layout.segments - 1
        for f, k, sign in ((0, 0, 1), (6, min(1, order), -1), (11, 0, -1)):
            room = INT32_MAX - _floors_above(order, k)
            for value in (room, room + 1):
                yield (
                    f"c_{k} of function {f}",
                    [
                        Change(layout.coefficient(s, f - f % 4, 0), 0, self.nil),
                        Change(layout.coefficient(s, f, k), sign * value),
                    ],
                )
        yield "INT32_MIN", [Change(layout.coefficient(s, 5, order), INT32_MIN)]

    def _rows(self) -> Iterator[tuple[str, list[Change]]]:
        """Rows just below their limit and at it: a gain, and what is left as the offset."""
        layout = self.layout
        if layout.inverse:
            return
        floors = sum_of_floors(layout.order)
        for row, excess in itertools.product(range(3), (-1, 0)):
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

    def _terms(self) -> Iterator[tuple[str, list[Change]]]:
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

    def _rates(self) -> Iterator[tuple[str, list[Change]]]:
        layout = self.layout
        if not layout.rate:
            return
        low, high, gain = (layout.rate_word(k) for k in (RATE_MIN, RATE_MAX, RATE_GAIN))
        for first, last in ((1, 1), (-1, -1), (-INT32_MAX, 0), (INT32_MIN, 0), (0, INT32_MAX)):
            changes = [Change(low, first), Change(high, last), Change(gain, 1)]
            yield f"rates {first} to {last}", changes
        yield "rate gain 0", [Change(gain, 0)]
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
        for name, words in itertools.islice(rate_ties(layout, self.plan.shape), 0, 4, 2):
            yield name, _runs(words)

    def _inverses(self) -> Iterator[tuple[str, list[Change]]]:
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
