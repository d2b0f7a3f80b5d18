"""The specification in ACSL gives the integers of the Python model.

WP proves the C equal to the specification, and the cross-check compares the C with the model. Here
the third side: the definitions themselves are run (`acsl`), without any C.
"""

from __future__ import annotations

import itertools
import random
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from plans import (
    COVERING,
    ROW_LIMIT,
    ROW_LIMIT_QUADRATIC,
    integer_plan,
    integer_shape,
    random_function,
    random_matrix_rows,
    random_plan,
    random_rows,
    vectors,
)
from triaxcal.codegen.image import constant_words, image_bytes
from triaxcal.codegen.image_cases import SENSITIVITY_LIMIT, image_cases, layout_of
from triaxcal.codegen.image_edges import image_edges
from triaxcal.codegen.render import render_routine, specification
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.shape import Shape
from verify.acsl import Pointer, definitions, quotient

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
WRITTEN = {name: shape for name, shape in COVERING.items() if not shape.rate}
"""Shapes whose specification is written."""

SEGMENTED = "two segments, 24-bit codes"
GYRO_SEGMENTED = "gyro, two segments, 32-bit codes"
WRITTEN[SEGMENTED] = integer_shape(segments=2, order=2)
WRITTEN |= {
    "gyro": replace(integer_shape(order=2), gyro=True),
    GYRO_SEGMENTED: replace(
        integer_shape(segments=2, order=1, raw=(INT32_MIN, INT32_MAX)), gyro=True
    ),
    "gyro, saturating, order 0": replace(integer_shape(order=0, output_shift=31), gyro=True),
}

Definitions = dict[str, Callable[..., Any]]


def plan_of(name: str) -> Plan:
    """Random constants of a shape within step R; a gyro's rows leave room for the force."""
    rng = random.Random(name)
    shape = WRITTEN[name]
    if not shape.gyro:
        return random_plan(rng, shape)
    rows = [random_rows(rng, shape.order, full=True, limit=ROW_LIMIT_QUADRATIC)] * shape.segments
    words = np.array([[rng.choice((-1, 1)) * (SENSITIVITY_LIMIT // 3)] * 3 for _ in range(3)])
    return replace(
        integer_plan(shape, rows), sensitivity=words, real_sensitivity=words * 1.0, force_q=24
    )


def defined(plan: Plan) -> Definitions:
    """The specification of a plan's shape, as functions."""
    header = next(text for name, text in render_routine(plan).items() if name.endswith("comp.h"))
    lines = re.findall(r"^#define (TRIAX_\w+) (\([-\d ]+\)|\d+)u?(?: .*)?$", header, re.MULTILINE)
    macros = {name: _sum_of(value) for name, value in lines}
    triad = "TRIAX_GYRO" if plan.shape.gyro else "TRIAX"
    assert {f"{triad}_RAW_MIN", f"{triad}_RAW_MAX", f"{triad}_SEGMENTS"} <= set(macros)
    return definitions(specification(plan, opaque=False), macros)


def _sum_of(text: str) -> int:
    """A number of the C, or (-2147483647 - 1)."""
    return sum(int(part) for part in re.findall(r"-?\d+", text.replace("- ", "-")))


def constants_of(words: Sequence[int], shape: Shape) -> Pointer:
    """The structure of the C from the words of the image behind its header."""
    step = 3 + 12 * (shape.order + 1)
    segments = []
    for s in range(shape.segments):
        first, origin, gain, *rest = words[2 + s * step : 2 + (s + 1) * step]
        rows = [rest[f * (shape.order + 1) : (f + 1) * (shape.order + 1)] for f in range(12)]
        segments.append(
            SimpleNamespace(first_code=first, origin_code=origin, gain=gain, coefficient=rows)
        )
    low, high = words[:2]
    calib = SimpleNamespace(temp_min_code=low, temp_max_code=high, segment=segments)
    if shape.gyro:
        terms = words[2 + shape.segments * step :]
        calib.sensitivity = [list(terms[3 * i : 3 * i + 3]) for i in range(3)]
    if shape.quadratic:
        terms = words[2 + shape.segments * step :]
        calib.quadratic = [list(terms[6 * i : 6 * i + 6]) for i in range(3)]
    return Pointer([calib])


def states_of(plan: Plan, codes: Sequence[int]) -> Iterator[tuple[Pointer, int]]:
    """The model's state and status at each temperature code."""
    state, status = set_temperature(plan, np.array(codes, dtype=np.int64))
    rows = np.concatenate([state.gain, state.offset[:, :, None]], axis=2).tolist()
    terms = {
        name: words.tolist()
        for name in ("sensitivity", "quadratic")
        if (words := getattr(plan, name)) is not None
    }
    for row, bits in zip(rows, status.tolist(), strict=True):
        yield Pointer([SimpleNamespace(row=row, **terms)]), bits


def compare_results(name: str) -> None:
    """States, status and results of one shape, at limits and at random."""
    shape, plan = WRITTEN[name], plan_of(name)
    rng = random.Random(name)
    spec = defined(plan)
    quarter = (ROW_LIMIT_QUADRATIC if shape.adds_to_sums else ROW_LIMIT) // 4
    temps, raws = vectors(plan, rng, 200)
    calib = constants_of(constant_words(plan), shape)
    assert spec["calib_fits"](calib)
    state, _ = set_temperature(plan, np.array(temps, dtype=np.int64))
    ends = [INT32_MIN, -1, 0, 1, INT32_MAX]
    forces = [[rng.choice([*ends, rng.randint(-(2**25), 2**25)]) for _ in range(3)] for _ in temps]
    codes, force = (np.array(rows, dtype=np.int64) for rows in (raws, forces))
    results, flags = (part.tolist() for part in apply(plan, state, codes, force))
    samples = zip(temps, raws, forces, states_of(plan, temps), results, flags, strict=True)
    for temp, raw, force_at, (state_at, status), result, flag in samples:
        clamped = min(max(temp, plan.temp_min_code), plan.temp_max_code)
        assert spec["temperature_status"](calib, temp) == status
        assert spec["state_is"](state_at, calib, clamped)
        rows = state_at[0].row
        assert spec["state_fits"](Pointer(rows))
        for i, row in enumerate(rows):
            offset = (-1) ** i * ((quarter - 1) // 2)
            kept, row[:] = row[:], [quarter, -quarter, quarter, offset]
            assert spec["state_fits"](Pointer(rows))
            row[1] -= 2
            assert not spec["state_fits"](Pointer(rows))
            row[:] = kept
        i, j = rng.randrange(3), rng.randrange(4)
        rows[i][j] += 1
        assert not spec["state_is"](state_at, calib, clamped)
        rows[i][j] -= 1
        u = [spec["code_of"](code) for code in raw]
        more: list[tuple[int, ...]] = [()] * 3
        if shape.gyro:
            assert spec["terms_are"](state_at, calib)
            assert spec["terms_fit"](Pointer(state_at[0].sensitivity))
            more = [(spec["added"](Pointer(k), *force_at),) for k in state_at[0].sensitivity]
        if shape.quadratic:
            assert spec["terms_are"](state_at, calib)
            assert spec["terms_fit"](Pointer(state_at[0].quadratic))
            more = [(spec["added"](Pointer(q), state_at, *u),) for q in state_at[0].quadratic]
        pairs = list(zip(rows, more, strict=True))
        assert [spec["result"](Pointer(row), *u, *also) for row, also in pairs] == result
        exact = [spec["exact"](Pointer(row), *u, *also) for row, also in pairs]
        expected = spec["raw_status"](*raw)
        expected += spec["saturated_status"](*exact) if shape.saturates else 0
        assert expected == flag


@pytest.mark.parametrize("name", ["direct-cubic-24-bit", SEGMENTED])
def test_every_code_of_a_range(name: str) -> None:
    """All temperatures of a range of 14 081 codes."""
    shape = WRITTEN[name]
    plan = next(
        p for seed in itertools.count()
        if (p := random_plan(random.Random(seed), shape)).temp_max_code - p.temp_min_code == 14080
    )  # fmt: skip
    spec = defined(plan)
    calib = constants_of(constant_words(plan), shape)
    codes = range(plan.temp_min_code, plan.temp_max_code + 1)
    for code, (state, _) in zip(codes, states_of(plan, codes), strict=True):
        assert spec["state_is"](state, calib, code)


def compare_constants(name: str) -> None:
    """What is accepted, at every limit of the image, and one beyond."""
    shape, plan = WRITTEN[name], plan_of(name)
    fits = defined(plan)["calib_fits"]
    layout = layout_of(plan)
    image = image_bytes(plan)
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    verdicts = []
    for change, values in image_edges(layout, words, shape):
        if not all(INT32_MIN <= value <= INT32_MAX for value in values.values()):
            continue
        changed = [values.get(at, word) for at, word in enumerate(words)]
        found = fits(constants_of(changed[layout.header :], shape))
        assert found == layout.is_safe(changed), change
        verdicts.append(found)
    assert {True, False} == set(verdicts)


@pytest.mark.parametrize("name", list(WRITTEN))
def test_specification_and_model_agree(name: str) -> None:
    compare_results(name)
    compare_constants(name)


LOADED = (
    SEGMENTED,
    "direct-cubic-24-bit",
    "direct-order-0",
    "direct-32-bit-two-segments",
    "direct-16-bit",
    "high-words-two-segments",
    "inverse-order-2",
    "inverse-32-bit-three-segments",
    "gyro",
    GYRO_SEGMENTED,
)
"""Orders that the loader is proven for, sums of high words, the inverse form and gyros."""


@pytest.mark.parametrize("name", LOADED)
def test_the_loader_accepts_what_the_model_does(name: str) -> None:
    """Images that are damaged, at every limit, wild, and with an identity."""
    plan = plan_of(name)
    spec = defined(plan)
    verdicts = []
    for case in image_cases(plan, image_bytes(plan)):
        # One byte of sixteen is damaged here, and of each word of the header.
        if (damaged := re.fullmatch(r"bit of byte (\d+)", case.name)) and int(damaged[1]) % 16 > 0:
            continue
        found = spec["accepted"](Pointer(list(case.image)), len(case.image))
        assert found == case.accepted, case.name
        verdicts.append(found)
    assert verdicts.count(True) > 20
    assert verdicts.count(False) > 100


@pytest.mark.parametrize("name", [name for name, shape in WRITTEN.items() if shape.inverse])
def test_what_cannot_be_inverted_is_known(name: str) -> None:
    """K from full words to small ones, whose inverse does not fit, and anything for K."""
    rng = random.Random(name)
    shape = WRITTEN[name]
    spec = defined(random_plan(rng, shape))
    verdicts = []
    for size in (1.0, 0.7, 0.5, 0.35, 0.25, 0.1, 0.0, None) * 6:
        rows = [
            [random_function(rng, shape.order, INT32_MAX, full=False) for _ in range(12)]
            if size is None
            else random_matrix_rows(rng, shape.order, size)
            for _ in range(shape.segments)
        ]
        plan = integer_plan(shape, rows)
        calib = constants_of(constant_words(plan), shape)
        assert spec["calib_fits"](calib)
        codes = [rng.randint(plan.temp_min_code, plan.temp_max_code) for _ in range(3)]
        for code, (state, _) in zip(codes, states_of(plan, codes), strict=True):
            found = spec["state_fits"](Pointer(state[0].row))
            assert spec["code_invertible"](calib, code) == found
            assert spec["state_is"](state, calib, code)
            verdicts.append(found)
    assert {True, False} == set(verdicts)


def test_rows_of_zeros() -> None:
    zero = defined(plan_of("inverse-order-2"))["rows_are_zero"]
    rows = [[0] * 4 for _ in range(3)]
    assert zero(Pointer(rows))
    for i, j in itertools.product(range(3), range(4)):
        rows[i][j] = -1
        assert not zero(Pointer(rows))
        rows[i][j] = 0


def test_words_and_crc_of_an_image() -> None:
    plan = random_plan(random.Random(1), WRITTEN[SEGMENTED])
    spec = defined(plan)
    image = random.Random(2).randbytes(400)
    read = Pointer(list(image))
    for i, word in enumerate(struct.unpack("<100I", image)):
        assert spec["word"](read, i) == word
    for i, word in enumerate(struct.unpack("<100i", image)):
        assert spec["int_word"](read, i) == word
    for size in (0, 1, 7, 400):
        assert spec["crc_of"](read, size) == zlib.crc32(image[:size])


def test_small_numbers_exhaustively() -> None:
    plan = random_plan(random.Random(1), COVERING["direct-cubic-24-bit"])
    spec = defined(plan)
    for value in range(-5000, 5001):
        assert spec["floor_4"](value) == value >> 4
    edges = [m * 2**32 + d for m in range(-9, 10) for d in range(-9, 10)]
    for value in edges:
        assert spec["floor_32"](value) == value >> 32
        assert spec["floor_36"](16 * value) == value >> 32
        assert spec["floor_36"](16 * value - 1) == (16 * value - 1) >> 36
    words = [sign * 2**k + d for k in (0, 1, 16, 29, 30) for sign in (-1, 1) for d in (-1, 0, 1)]
    for c, x, p in itertools.product(words, repeat=3):
        assert spec["step"](c, x, p) == c + (x * p >> 32)
        assert abs(spec["step"](c, x, p)) <= spec["step_bound"](c, abs(p))
    limits = [plan.shape.raw_min, plan.shape.raw_max]
    near = [limit + d for limit in limits for d in range(-40, 41)]
    inside = [limits[0] <= code <= limits[1] for code in near]
    for (code, good), (more, also) in itertools.product(zip(near, inside, strict=True), repeat=2):
        assert (spec["raw_status"](code, 0, more) == 0) == (good and also)
        assert spec["in_range"](code, more, 5) == (good and also)
    for code in near:
        assert spec["code_of"](code) == min(max(code, limits[0]), limits[1]) * 256
        assert spec["above_min"](code) == (code - limits[0]) % 2**32


def test_the_reading_of_acsl() -> None:
    text = """/*@ axiomatic a {
      logic integer q(integer v) = v / 3 + v % 3; // towards zero
      lemma l: \\forall integer v; \\exists integer w; v == w;
      logic integer later(integer v);
      predicate p{L}(int32_t (*r)[4], integer n) =
        \\forall integer k; 0 <= k < n ==> r[1][k] < k <= 3 && !(k == 9);
      predicate one_or{L}(int32_t *r) = r[0] == 1 ==> r[1] == 2 || r[2] == 3;
      logic integer chosen(integer v) = v < 0 ? -1 : v > 0 ? LIMIT : 0;
      logic thing_t *part{L}(thing_t *t, integer i) = &t->part[i + 1];
      logic integer word{P,L}(thing_t *t) = \\at(part{L}(t, 0)->word, P) - 1 - 1;
    } */"""
    spec = definitions(text, {"LIMIT": 7})
    assert [spec["q"](v) for v in (-7, -1, 7)] == [-2 - 1, -1, 2 + 1]
    assert quotient(-7, 2) == -3
    assert spec["p"](Pointer([[9] * 4, [-1, 0, 1, 2]]), 4)
    assert not spec["p"](Pointer([[-1] * 4, [-1, 0, 1, 3]]), 4)
    assert spec["one_or"](Pointer([1, 2, 0]))
    assert spec["one_or"](Pointer([0, 0, 0]))
    assert not spec["one_or"](Pointer([1, 0, 0]))
    assert [spec["chosen"](v) for v in (-5, 0, 5)] == [-1, 0, 7]
    thing = Pointer([SimpleNamespace(part=[SimpleNamespace(word=k) for k in (1, 5)])])
    assert spec["word"](thing) == 3
    assert "later" not in spec
    with pytest.raises(IndexError):
        spec["part"](thing, 1)[0]
    with pytest.raises(ValueError, match=r"'>' for '<='"):
        definitions("/*@ predicate p(integer n) = \\forall integer k; k > n ==> k > 0; */", {})


FAULTS = {
    "a floor towards zero": ("v >= 0 ? v / d : -1 - (-1 - v) / d", "v / d"),
    "x of half the gain": ("scaled(code - s->origin_code", "scaled((code - s->origin_code) / 2"),
    "a segment too late": ("code >= c->segment[n - 1]", "code > c->segment[n - 1]"),
    "a bound one lower": ("mag(c) + b / 2 + 1", "mag(c) + b / 2"),
    "a row's limit one higher": ("2 * mag(d) < 4294967288", "2 * mag(d) <= 4294967288"),
    "offsets counted once": ("+ 2 * bound(", "+ bound("),
    "the last code of a segment": ("first_code - 1 : c->temp_max", "first_code : c->temp_max"),
    "segments from the second": ("0 <= s < TRIAX_SEGMENTS", "1 <= s < TRIAX_SEGMENTS"),
    "a gain of 0": ("gain > 0 && first", "gain >= 0 && first"),
    "rows of another axis": ("row[1][0], P), s, 4, 4", "row[1][0], P), s, 8, 4"),
    "a status of the other end": ("? TRIAX_STATUS_TEMP_LOW", "? TRIAX_STATUS_TEMP_HIGH"),
    "y counted as x": ("prod(b, y)", "prod(b, x)"),
    "half an offset": ("r[3] * 4294967296", "r[3] * 2147483648"),
    "no range for z": ("TRIAX_RAW_MIN <= z <= TRIAX_RAW_MAX ?", "z == z ?"),
    "codes clamped one lower": ("clamp(raw, TRIAX_RAW", "clamp(raw - 1, TRIAX_RAW"),
}  # fmt: skip


@pytest.mark.parametrize("name", list(FAULTS))
def test_a_mistake_in_the_specification_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = FAULTS[name]
    plan = random_plan(random.Random(1), WRITTEN[SEGMENTED])
    text = specification(plan, opaque=False)
    assert old in text
    monkeypatch.setattr(f"{__name__}.specification", lambda *_, **__: text.replace(old, new))
    with pytest.raises((AssertionError, IndexError)):
        test_specification_and_model_agree(SEGMENTED)


QUADRATIC_FAULTS = {
    "xy for xz": ("product_of(x, z)", "product_of(x, y)"),
    "a word of another product": ("prod(q[1], yy)", "prod(q[1], xx)"),
    "products without the offset": ("x, y, z)) + r[3];", "x, y, z));"),
    "a product one more": ("= floor_32(prod(a, b));", "= floor_32(prod(a, b)) + 1;"),
    "a linear result of another axis": ("linear(&t->row[2][0]", "linear(&t->row[1][0]"),
    "terms subtracted": (" + more + ", " - more + "),
    "half an output LSB left out": (" + 17179869184;", ";"),
    "a limit one lower": ("mag(k[5]) <= 2147483647", "mag(k[5]) < 2147483647"),
    "one word not counted": ("mag(k[4]) + mag(k[5])", "mag(k[4])"),
}


@pytest.mark.parametrize("name", list(QUADRATIC_FAULTS))
def test_a_mistake_in_quadratic_terms_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = QUADRATIC_FAULTS[name]
    text = specification(plan_of("quadratic-cubic"), opaque=False)
    assert text.count(old) == 1
    monkeypatch.setattr(f"{__name__}.specification", lambda *_, **__: text.replace(old, new))
    with pytest.raises(AssertionError):
        test_specification_and_model_agree("quadratic-cubic")


LOADER_FAULTS = {
    "another CRC": ("0xEDB88320", "0xEDB88321"),
    "bytes from the other end": ("1] << 8", "1] << 24"),
    "no limit of the last code": (
        "first_code(image, s + 1) - 1 : max_code",
        "max_code(image) : max_code",
    ),
    "functions of another row": ("row_words_fit(image, s, 8)", "row_words_fit(image, s, 4)"),
    "any identity": ("==> identity_fits(image))", "==> size > 0)"),
    "no header": ("&& header_fits(image) &&", "&&"),
    "terms not looked at": ("&& terms_words_fit(image)", ""),
    "the last of terms left out": (
        "sum_of_terms(image, i, 3) <= 5",
        "sum_of_terms(image, i, 2) <= 5",
    ),
}


@pytest.mark.parametrize("name", list(LOADER_FAULTS))
def test_a_mistake_in_what_is_accepted_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = LOADER_FAULTS[name]
    shape = "gyro" if "terms" in name else SEGMENTED
    text = specification(plan_of(shape), opaque=False)
    assert text.count(old) == 1
    monkeypatch.setattr(f"{__name__}.specification", lambda *_, **__: text.replace(old, new))
    with pytest.raises(AssertionError):
        test_the_loader_accepts_what_the_model_does(shape)
