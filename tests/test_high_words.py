"""Sums of high words: when they are taken, what they give, and how near their bound is reached."""

from __future__ import annotations

import itertools
import struct
import zlib
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import pytest

import oracle
import triaxcal
from plans import COVERING, GOLDEN, integer_plan, integer_shape
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.forms import assembly, form_of, limb_split
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.routines import Reference
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.order import Functions, allowed_error_g, choose_functions
from triaxcal.fixedpoint import integer_model
from triaxcal.fixedpoint.plan import Plan, make_plan, with_high_words
from triaxcal.fixedpoint.proof import prove
from triaxcal.unit.arithmetic import ARITHMETICS, HIGH_WORDS, LIMBS, PORTABLE
from triaxcal.verify.image_reader import read_image

UNITS = Path(__file__).parent.parent / "units"
SHIPPED = ("AT-CHERNIAK", "AT-SIM")


@cache
def fitted(name: str) -> Fitted:
    return triaxcal.fit(triaxcal.read_unit(UNITS / name)).fitted


def chosen(name: str, **changes: object) -> Functions:
    f = fitted(name)
    return choose_functions(replace(f.unit, **changes), f.measurements, f.calibration)


# ---- when they are taken ----


@pytest.mark.parametrize("name", SHIPPED)
def test_they_are_taken_where_they_are_asked_for_and_keep_the_share(name: str) -> None:
    asked, before = chosen(name, arithmetic=HIGH_WORDS), chosen(name)
    assert asked.plan.shape == replace(before.plan.shape, high_words=True)
    assert asked.error_g <= allowed_error_g(fitted(name).unit, asked.least_u_g)
    assert before.bound.lsb < asked.bound.lsb < 1.0
    for other in ARITHMETICS:
        if other != HIGH_WORDS:
            assert not chosen(name, arithmetic=other).plan.shape.high_words


def test_they_are_not_taken_where_their_error_is_too_large() -> None:
    """A tenth of the smallest limit, put between both errors, and just above the larger one."""
    stated = {"model_error_max_micro_g": 10.0}
    limits = fitted("AT-SIM").unit.limits
    small = chosen("AT-SIM", **stated).error_g
    large = chosen("AT-SIM", arithmetic=HIGH_WORDS, **stated).error_g
    assert small < large
    for limit_g, taken in ((5 * (small + large), False), (10 * large * (1 + 1e-9), True)):
        narrow = replace(limits, at_t0_g=limit_g)
        found = chosen("AT-SIM", arithmetic=HIGH_WORDS, limits=narrow, **stated)
        assert found.plan.shape.high_words == taken
        assert found.plan.arithmetic == HIGH_WORDS
        assert form_of(found.plan.shape, HIGH_WORDS) == PORTABLE


def test_a_shape_that_saturates_or_has_terms_or_an_inverse_has_none() -> None:
    made = {name: integer_plan(shape, [[[0] * (shape.order + 1)] * 12] * shape.segments)
            for name, shape in COVERING.items()}  # fmt: skip
    has = {name for name, plan in made.items() if with_high_words(plan) is not None}
    assert has == {
        name
        for name, shape in COVERING.items()
        if shape.form == "direct" and shape.output_shift > 32 and not shape.quadratic
    }
    assert not chosen("AT-SIM", arithmetic=HIGH_WORDS, output_q=28).plan.shape.high_words
    assert not chosen("AT-SIM", arithmetic=HIGH_WORDS, method="inverse").plan.shape.high_words


def test_they_have_one_form_and_limbs_for_the_thermal_functions() -> None:
    shape = COVERING["high-words-cubic-24-bit"]
    assert limb_split(shape) == 0 < limb_split(replace(shape, high_words=False))
    assert not any(assembly(shape)[form] for form in ("thumb1", "thumb2", "in_sum"))
    assert [form_of(shape, asked) for asked in ARITHMETICS] == [
        PORTABLE, LIMBS, PORTABLE, LIMBS, PORTABLE,
    ]  # fmt: skip


def test_a_plan_alone_has_64_bit_sums() -> None:
    """As an IMU's, which is made without the uncertainty that decides."""
    unit = replace(fitted("AT-SIM").unit, arithmetic=HIGH_WORDS)
    assert not make_plan(chosen("AT-SIM").compensation, unit).shape.high_words


def test_the_api_gives_the_bits_of_the_c() -> None:
    calibration = triaxcal.fit(triaxcal.read_unit(UNITS / "AT-SIM"))
    firmware = triaxcal.firmware(calibration, arithmetic=HIGH_WORDS)
    plain = triaxcal.firmware(calibration)
    rng = np.random.default_rng(5)
    raw = rng.integers(-(2**23), 2**23, (4000, 3))
    temp = rng.integers(firmware.plan.temp_min_code, firmware.plan.temp_max_code, 4000)
    accel, status = firmware.apply(raw, temp)
    with firmware.compiled() as c:
        found = c.apply(raw, temp)
    assert np.array_equal(found[0], accel)
    assert np.array_equal(found[1], status)
    other, _ = plain.apply(raw, temp)
    assert 0 < np.abs(accel - other).max() <= 1
    assert firmware.error_g > plain.error_g


# ---- what they give ----


def test_floors_worked_by_hand() -> None:
    # Order 0, u = 2^30 * raw_code: products of 3 u / 2^32 = 3/4 are floored one by one.
    rows = [[0]] * 12
    rows[0] = rows[1] = rows[2] = [3]
    rows[3] = [1]
    shape = integer_shape(order=0, output_shift=33, raw=(-2, 1), high_words=True)
    assert shape.raw_shift == 30
    plan = integer_plan(shape, [rows])
    # 0 + 0 + 0 + 1 = 1, and 1 >> 1 = 0; the 64-bit sum is 9/4, its floor 2, and (2 + 1) >> 1 = 1.
    assert run(plan, [1, 1, 1]) == 0
    assert run(replace(plan, shape=replace(shape, high_words=False)), [1, 1, 1]) == 1
    # floor(-6/4) = -2 each: (-6 + 1) >> 1 = -3; floor(-18/4) = -5: (-5 + 1) >> 1 = -2.
    assert run(plan, [-2, -2, -2]) == -3
    assert run(replace(plan, shape=replace(shape, high_words=False)), [-2, -2, -2]) == -2


def run(plan: Plan, raw: list[int]) -> int:
    state, _ = integer_model.set_temperature(plan, np.array([0]))
    accel, status = integer_model.apply(plan, state, np.array([raw]))
    assert status[0] == 0
    assert accel[0].tolist() == oracle.run(plan, 0, raw)[0]
    return int(accel[0, 0])


def test_three_floors_are_the_floor_of_the_sum_less_0_1_or_2() -> None:
    """Step A, for all remainders of three products of small words."""
    less = {
        (x + y + z) // 16 - (x // 16 + y // 16 + z // 16)
        for x, y, z in itertools.product(range(-16, 16), repeat=3)
    }
    assert less == {0, 1, 2}


@pytest.mark.parametrize("name", SHIPPED)
def test_the_error_comes_near_the_bound_and_stays_below(name: str) -> None:
    """Raw codes near corners, whose remainders add to what the gains' rounding makes there."""
    plan = chosen(name, arithmetic=HIGH_WORDS).plan
    bound = prove(plan)
    axis = bound.per_axis_lsb.index(bound.lsb)
    rows, _ = oracle.set_temperature(plan, bound.temp_code)
    real = oracle.real_gain_and_offset(plan, bound.temp_code)
    rng = Random(name)
    worst = Fraction(0)
    for _ in range(2500):
        raw = [near_an_end(plan, n, exact, rng)
               for n, exact in zip(rows[axis][:3], real[axis][:3], strict=True)]  # fmt: skip
        found, _ = oracle.apply(plan, rows, raw)
        worst = max(worst, abs(found[axis] - oracle.real_accel(plan, real, raw)[axis]))
    assert Fraction(9, 10) * Fraction(bound.lsb) < worst <= Fraction(bound.lsb)


def near_an_end(plan: Plan, gain: int, real: Fraction, rng: Random) -> int:
    """A raw code near an end of the range, of sixty the one whose floor loses least or most.

    Least where the rounding of the gain makes the product too large, most where too small.
    """
    end, inwards = rng.choice([(plan.shape.raw_min, 1), (plan.shape.raw_max, -1)])
    near = (plan.shape.raw_max - plan.shape.raw_min) >> 10
    codes = [end + inwards * rng.randrange(near) for _ in range(60)]
    sign = 1 if (gain - real) * end > 0 else -1
    return min(codes, key=lambda u: sign * (gain * u * 2**plan.shape.raw_shift % 2**32))


def test_the_bound_grows_by_one_unit_of_the_offset() -> None:
    plan = chosen("AT-SIM").plan
    high = with_high_words(plan)
    assert high is not None
    for before, after in zip(plan.segments, high.segments, strict=True):
        moved = after.coefficients - before.coefficients
        assert moved[3::4, 0].tolist() == [1, 1, 1]
        moved[3::4, 0] = 0
        assert not moved.any()
    unit = 2.0 ** (32 - plan.shape.output_shift)
    grown = np.subtract(prove(high).per_axis_lsb, prove(plan).per_axis_lsb)
    assert grown == pytest.approx([unit] * 3, abs=1e-15)


# ---- the image ----


def test_the_image_says_so() -> None:
    plan = GOLDEN["direct-high-words"]
    image = image_bytes(plan)
    words = struct.unpack(f"<{len(image) // 4}I", image)
    assert (words[1], words[15]) == (2, 8)
    assert len(image) == len(image_bytes(GOLDEN["direct-checked"])) + 4
    assert read_image(image).high_words
    assert not read_image(image_bytes(GOLDEN["direct-checked"])).high_words
    assert read_image(image).segments[0].coefficients[0] == (-1217976128, 2692664, -5015)


@pytest.mark.parametrize(
    ("word", "value"),
    [(3, 1), (7, 32), (15, 9), (15, 12), (15, 0), (15, 16)],
    ids=["inverse form", "no spare bit", "quadratic too", "of a gyro", "no terms", "unknown"],
)
def test_the_reference_refuses_what_has_no_sums_of_high_words(
    reference: Reference, word: int, value: int
) -> None:
    image = image_bytes(GOLDEN["direct-high-words"])
    nothing = np.zeros(0, np.int32), np.zeros((0, 3), np.int32)
    reference.routine(image)(*nothing)
    words = list(struct.unpack(f"<{len(image) // 4}I", image))[:-1]
    words[word] = value
    payload = struct.pack(f"<{len(words)}I", *words)
    changed = payload + struct.pack("<I", zlib.crc32(payload))
    with pytest.raises(RefusedError, match="the image was refused"):
        reference.routine(changed)(*nothing)
