"""Images that the loader must accept or refuse, at and just beyond every limit of step R.

What is accepted is decided here from docs/explanation/fixed-point.md, step R, in Python's
unbounded integers, not by the code that plans or proves. Accepted images, however wild their
constants, must give the same answers in the generated C and in the reference C.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.identity import with_identity
from triaxcal.codegen.image import QUADRATIC, RATE, SENSITIVITY, header_names, terms_word
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
from triaxcal.codegen.routines import Generated, Reference, difference
from triaxcal.fixedpoint.integer_model import STATUS_BAD_IMAGE, STATUS_OK
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.methods.method import INVERSE
from triaxcal.unit.thermometer import TemperatureSensor

QUADRATIC_LIMIT, SENSITIVITY_LIMIT = 2**31 - 1, 2**29
_TABLES = {0: (0, 0), QUADRATIC: (6, QUADRATIC_LIMIT), SENSITIVITY: (3, SENSITIVITY_LIMIT)}
SEED = 20130527
WILD_IMAGES = 48


@dataclass(frozen=True)
class ImageCase:
    """An image and whether the loader has to accept it."""

    name: str
    image: bytes
    accepted: bool


def check_images(
    plan: Plan, cases: Sequence[ImageCase], generated: Generated, reference: Reference
) -> int:
    """Load every case, run the accepted ones, and return how many cases there were.

    Raises
    ------
    RefusedError
        At the first image that is wrongly accepted or refused, or answered in two ways.
    """
    temp, raw = case_vectors(plan)
    for case in cases:
        status, answers = generated.run_image(case.image, temp, raw)
        expected = STATUS_OK if case.accepted else STATUS_BAD_IMAGE
        if status != expected:
            raise RefusedError(
                f"triax_calib_load, image '{case.name}'",
                f"status {status}",
                expected=f"status {expected}",
                remedy="do not use this build, report it",
            )
        if case.accepted:
            differs = difference(answers, reference.routine(case.image)(temp, raw))
            if differs is not None:
                i = differs.first
                raise RefusedError(
                    f"image '{case.name}', temp_code {temp[i]}, raw_code {raw[i].tolist()}",
                    f"generated C gives {differs.found}",
                    expected=differs.expected,
                    remedy="do not use this build, report it",
                )
    return len(cases)


def image_cases(plan: Plan, image: bytes) -> list[ImageCase]:
    """Damaged images, images at the limits of step R, and wild ones."""
    shape = plan.shape
    names = header_names(plan)
    layout = layout_of(plan)
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    cases = [ImageCase(name, damaged, False) for name, damaged in _damaged(image, names)]
    cases += _identities(image)
    changes = itertools.chain(
        _temperature_edges(layout, words), _coefficient_edges(layout, words),
        _row_edges(layout, words), _wild(layout, words), _inverse_edges(layout, plan),
        _term_edges(layout), rate_edges(layout, words), rate_ties(layout, shape),
    )  # fmt: skip
    for name, change in changes:
        if not all(INT32_MIN <= value <= INT32_MAX for value in change.values()):
            continue  # beyond what a word holds: no image says so
        changed = words.copy()
        for index, value in change.items():
            changed[index] = value
        cases.append(ImageCase(name, _sealed(changed), layout.is_safe(changed)))
    return cases


def layout_of(plan: Plan) -> Layout:
    """Where the words of a plan's image stand."""
    shape, terms = plan.shape, terms_word(plan)
    columns, limit = _TABLES[terms & (QUADRATIC | SENSITIVITY)]
    return Layout(
        len(header_names(plan)), shape.segments, shape.order, shape.form == INVERSE, columns,
        limit, bool(terms & RATE),
    )  # fmt: skip


Change = tuple[str, dict[int, int]]
"""A name, and words by index."""


def _sealed(words: list[int]) -> bytes:
    payload = struct.pack(f"<{len(words)}i", *words)
    return payload + struct.pack("<I", zlib.crc32(payload))


def _damaged(image: bytes, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    for size in (0, 4, len(image) - 4, len(image) - 1):
        yield f"cut to {size} bytes", image[:size]
    for more in (1, 4):
        yield f"{more} bytes too long", image + bytes(more)
    for at in range(len(image)):
        yield f"bit of byte {at}", image[:at] + bytes([image[at] ^ 1 << at % 8]) + image[at + 1 :]
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    for at, name in enumerate(names):
        for bit in (1, INT32_MIN):
            yield f"{name}, CRC right", _sealed([*words[:at], words[at] ^ bit, *words[at + 1 :]])


def _identities(image: bytes) -> Iterator[ImageCase]:
    """Files with an identity behind the constants: good, damaged, and of other constants."""
    sensor = TemperatureSensor(1.0 / 64.0, 0.0)
    file = with_identity(
        image, sensor, Provenance("CASE-1", "5A" * 32, (), "2026-03-30", "-Y, X, Z")
    )
    yield ImageCase("with identity", file, True)
    for size in (len(image) + 4, len(file) - 4, len(file) - 1):
        yield ImageCase(f"identity cut to {size} bytes", file[:size], False)
    for more in (1, 4):
        yield ImageCase(f"identity and {more} bytes", file + bytes(more), False)
    for at in range(len(file)):
        damaged = file[:at] + bytes([file[at] ^ 1 << at % 8]) + file[at + 1 :]
        yield ImageCase(f"with identity, bit of byte {at}", damaged, False)
    words = list(struct.unpack(f"<{len(file) // 4}i", file))[:-1]
    start = len(image) // 4
    for word, name in enumerate(("magic", "version", "CRC of the constants")):
        for bit in (1, INT32_MIN):
            at = start + word
            changed = _sealed([*words[:at], words[at] ^ bit, *words[at + 1 :]])
            yield ImageCase(f"{name} of the identity, CRC right", changed, False)


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


def _inverse_edges(layout: Layout, plan: Plan) -> Iterator[Change]:
    shape = plan.shape
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


def case_vectors(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Ends and middle of the temperature range and int32's ends x a few raw codes."""
    shape = plan.shape
    middle = (plan.temp_min_code + plan.temp_max_code) // 2
    beside = plan.segments[0].origin_code + 1
    temps = [INT32_MIN, plan.temp_min_code, beside, middle, plan.temp_max_code, INT32_MAX]
    raws = [INT32_MIN, 1, shape.raw_max // 3, shape.raw_max]
    rows = np.array(list(itertools.product(temps, raws, raws, raws)), dtype=np.int32)
    return np.ascontiguousarray(rows[:, 0]), np.ascontiguousarray(rows[:, 1:])
