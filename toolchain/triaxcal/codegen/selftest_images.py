"""Images of the self-test: what the loader on the device must take, and what it must refuse.

The device makes each from its own constants and a few changed words: at a limit of step R and one
beyond (docs/explanation/fixed-point.md), of another shape, damaged, with and without an identity.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.codegen.identity import IDENTITY_SIZE, MAGIC, VERSION
from triaxcal.codegen.image import header_words, image_bytes
from triaxcal.codegen.image_cases import layout_of
from triaxcal.codegen.image_layout import COEFFICIENTS, RATE_WORDS, Layout
from triaxcal.codegen.selftest_limits import Change, Limits
from triaxcal.codegen.selftest_vectors import Vectors, answers_of
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.fixedpoint.plan import Plan

IDENTITY_WORDS = IDENTITY_SIZE // 4


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
        for name, changes in Limits(self.plan, self.layout, self.words).all():
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
