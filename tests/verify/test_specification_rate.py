"""The specification of a term in dT/dt and the integer model agree, and mistakes in it are seen."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from plans import (
    INT32_MAX,
    INT32_MIN,
    ROW_LIMIT_QUADRATIC,
    integer_plan,
    integer_shape,
    random_rows,
)
from triaxcal.codegen.image import constant_words, image_bytes
from triaxcal.codegen.image_cases import image_cases, layout_of
from triaxcal.codegen.image_edges import image_edges
from triaxcal.codegen.render import specification
from triaxcal.fixedpoint.integer_model import set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.rate import RatePlan
from verify import test_specification
from verify.acsl import Pointer
from verify.test_specification import constants_of, defined

SHAPES = {
    "cubic": replace(integer_shape(order=3), rate=True),
    "two segments, 32 bits": replace(
        integer_shape(order=2, segments=2, raw=(INT32_MIN, INT32_MAX)), rate=True
    ),
}


def plan_of(name: str) -> Plan:
    """Random constants within step R, with room for the offsets of a rate."""
    rng = random.Random(name)
    shape = SHAPES[name]
    limit = ROW_LIMIT_QUADRATIC
    rows = [random_rows(rng, shape.order, full=True, limit=limit) for _ in range(shape.segments)]
    words = np.array([2**29 + 1, -(2**29) + 12345, rng.randint(-(2**29), 2**29)])
    return replace(integer_plan(shape, rows), rate=RatePlan(-1000, 900, 2**21, words, words * 1.0))


def read(words: Sequence[int], plan: Plan) -> Pointer:
    """The structure of the C from the words of the image behind its header."""
    calib = constants_of(words, plan.shape)
    low, high, gain, *offsets = words[-6:]
    calib[0].rate_min_code, calib[0].rate_max_code, calib[0].rate_gain = low, high, gain
    calib[0].rate_offset = offsets
    return calib


def compare(name: str) -> None:
    """States, status and accepted constants."""
    plan = plan_of(name)
    rng = random.Random(name)
    spec = defined(plan)
    calib = read(constant_words(plan), plan)
    assert spec["calib_fits"](calib)
    ends = [plan.temp_min_code, plan.temp_max_code, INT32_MIN, INT32_MAX]
    temps = [*ends, *(rng.randint(plan.temp_min_code, plan.temp_max_code) for _ in range(60))]
    rates = [INT32_MIN, -1001, -1000, -999, -1, 0, 1, 899, 900, 901, INT32_MAX]
    pairs = [(temp, rate) for temp in temps for rate in rates]
    codes = (np.array(part, dtype=np.int64) for part in zip(*pairs, strict=True))
    state, flags = set_temperature(plan, *codes)
    rows = np.concatenate([state.gain, state.offset[:, :, None]], axis=2).tolist()
    for (temp, rate), row, status in zip(pairs, rows, flags.tolist(), strict=True):
        at = Pointer([SimpleNamespace(row=row)])
        code = min(max(temp, plan.temp_min_code), plan.temp_max_code)
        found = spec["temperature_status"](calib, temp) + spec["rate_status"](calib, rate)
        assert found == status
        assert spec["state_moved"](at, calib, code, rate)
        assert spec["state_fits"](Pointer(row))
        if rate == 0:
            assert spec["state_is"](at, calib, code)
        i, j = rng.randrange(3), rng.randrange(4)
        row[i][j] += 1
        assert not spec["state_moved"](at, calib, code, rate)
    compare_constants(plan)


def compare_constants(plan: Plan) -> None:
    """What is accepted, at every limit of the image, and one beyond."""
    fits = defined(plan)["calib_fits"]
    layout = layout_of(plan)
    image = image_bytes(plan)
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    verdicts = []
    for change, values in image_edges(layout, words, plan.shape):
        if not all(INT32_MIN <= value <= INT32_MAX for value in values.values()):
            continue
        changed = [values.get(at, word) for at, word in enumerate(words)]
        found = fits(read(changed[layout.header :], plan))
        assert found == layout.is_safe(changed), change
        verdicts.append(found)
    assert {True, False} == set(verdicts)


@pytest.mark.parametrize("name", list(SHAPES))
def test_specification_and_model_agree(name: str) -> None:
    compare(name)


@pytest.mark.parametrize("name", list(SHAPES))
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


LOADER_FAULTS = {
    "rates not looked at": ("&& rate_words_fit(image)", ""),
    "no room for a rate": ("s, 4, rate_bound(rate_word(image, 4))", "s, 4, 0"),
    "the word of another axis": (
        "s, 0, rate_bound(rate_word(image, 3))",
        "s, 0, rate_bound(rate_word(image, 4))",
    ),
}
"""A mistake in what the loader is said to accept."""


@pytest.mark.parametrize("name", list(LOADER_FAULTS))
def test_a_mistake_in_what_is_accepted_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = LOADER_FAULTS[name]
    text = specification(plan_of("cubic"), opaque=False)
    assert text.count(old) == 1, text.count(old)
    monkeypatch.setattr(
        test_specification, "specification", lambda *_, **__: text.replace(old, new)
    )
    with pytest.raises(AssertionError):
        test_the_loader_accepts_what_the_model_does("cubic")


FAULTS = {
    "half a unit less": ("prod(r, w) + 2147483648)", "prod(r, w))"),
    "a rate of the other end": ("clamp(rate, c->rate_min_code", "clamp(rate, c->rate_max_code"),
    "the end itself is flagged": ("<= rate <= c->rate_max_code ?", "<= rate < c->rate_max_code ?"),
    "every rate in range": ("? 0 : TRIAX_STATUS_RATE_RANGE", "? 0 : 0"),
    "rates of one sign": ("c->rate_min_code <= 0 <=", "c->rate_min_code < 0 <="),
    "gains that are small": ("rate_fits(c) &&", "rate_fits(c) && c->rate_gain <= 1000 &&"),
    "gains of any size": ("rate_fits(c) &&", ""),
    "no room for a rate": ("[f + 3][0]) + more)", "[f + 3][0]))"),
    "room for half a rate": ("mag(r) / 2 + 1", "mag(r) / 4 + 1"),
    "the offset of another axis": ("rate_offset[1], L), rate_at", "rate_offset[0], L), rate_at"),
    "a rate subtracted": ("L) + d;", "L) - d;"),
}
"""A mistake in the specification; without the C a proof of WP says nothing of it."""


@pytest.mark.parametrize("name", list(FAULTS))
def test_a_mistake_in_the_specification_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = FAULTS[name]
    text = specification(plan_of("two segments, 32 bits"), opaque=False)
    assert text.count(old) == 1, text.count(old)
    monkeypatch.setattr(
        test_specification, "specification", lambda *_, **__: text.replace(old, new)
    )
    with pytest.raises(AssertionError):
        compare("two segments, 32 bits")
