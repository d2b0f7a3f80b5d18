"""The integer model and the reference C against an oracle written from fixed-point.md."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from builds import Built
from plans import (
    COVERING,
    GOLDEN,
    INT32_MAX,
    INT32_MIN,
    integer_plan,
    integer_shape,
    random_plan,
    vectors,
)
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.routines import Reference
from triaxcal.fixedpoint import integer_model
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import check_ranges

_INT32 = st.integers(INT32_MIN, INT32_MAX)


@st.composite
def raw_ranges(draw: st.DrawFn) -> tuple[int, int]:
    """Ranges of any width anywhere in int32: its ends, powers of two, and all between."""
    ends = st.one_of(
        st.sampled_from([INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX - 1, INT32_MAX]),
        st.builds(lambda n, d: 2**n + d, st.integers(0, 30), st.integers(-1, 1)),
        st.builds(lambda n, d: -(2**n) + d, st.integers(0, 30), st.integers(-1, 1)),
        _INT32,
    )
    low, high = sorted([draw(ends), draw(ends)])
    return (low, high) if low < high else (low - 1, low) if low > INT32_MIN else (low, low + 1)


@st.composite
def plans(draw: st.DrawFn, form: str) -> Plan:
    """Plans of any shape with constants that keep step R (inverse: nearly any constants)."""
    # The shifts of a planned inversion, or any that the image may hold.
    shifts = st.one_of(
        st.just((31, 29, 61, 31)),
        st.tuples(
            st.integers(24, 33), st.integers(24, 33), st.integers(55, 62), st.integers(27, 38)
        ),
        st.tuples(st.integers(0, 62), st.integers(0, 62), st.integers(31, 62), st.integers(1, 62)),
    )
    shape = integer_shape(
        form=form,
        segments=draw(st.integers(1, 8)),
        order=draw(st.integers(0, 9)),
        output_shift=draw(st.integers(28, 48)),
        raw=draw(raw_ranges()),
        shifts=draw(shifts),
    )
    return random_plan(Random(draw(st.integers(0, 2**32))), shape, full=draw(st.booleans()))


def model_run(plan: Plan, temps: list[int], raws: list[list[int]]) -> list[tuple[list[int], int]]:
    state, temp_status = integer_model.set_temperature(plan, np.array(temps, dtype=np.int64))
    raw = np.array(raws, dtype=np.int64).reshape(-1, 3)
    accel, status = integer_model.apply(plan, state, raw)
    either = np.bitwise_or(temp_status, status)
    return list(zip(accel.tolist(), either.tolist(), strict=True))


def reference_run(
    reference: Reference, plan: Plan, temps: list[int], raws: list[list[int]]
) -> list[tuple[list[int], int]]:
    accel, status = reference.routine(image_bytes(plan))(
        np.array(temps, dtype=np.int32), np.array(raws, dtype=np.int32)
    )
    return list(zip(accel.tolist(), status.tolist(), strict=True))


def compare(plan: Plan, reference: Reference, seed: int, count: int = 10) -> int:
    """Compare all three on `vectors`; returns how many the oracle did not call BAD_IMAGE."""
    temps, raws = vectors(plan, Random(seed), count)
    expected = [oracle.run(plan, t, raw) for t, raw in zip(temps, raws, strict=True)]
    assert reference_run(reference, plan, temps, raws) == expected
    # The integer model knows planned constants only: no BAD_IMAGE. It is asked about the rest.
    good = [i for i, (_, status) in enumerate(expected) if not status & oracle.BAD_IMAGE]
    found = model_run(plan, [temps[i] for i in good], [raws[i] for i in good])
    assert found == [expected[i] for i in good]
    return len(good)


@settings(max_examples=100)
@given(plan=plans("direct"), seed=st.integers(0, 2**32))
def test_direct_form_is_the_page(reference: Reference, plan: Plan, seed: int) -> None:
    check_ranges(plan)
    assert compare(plan, reference, seed) > 0


@settings(max_examples=100)
@given(plan=plans("inverse"), seed=st.integers(0, 2**32))
def test_inverse_form_is_the_page(reference: Reference, plan: Plan, seed: int) -> None:
    compare(plan, reference, seed)


@pytest.mark.parametrize("name", [*COVERING, *GOLDEN])
def test_generated_c_with_many_constants_is_the_page(
    built: dict[str, Built], reference: Reference, name: str
) -> None:
    shape = built[name].plan.shape
    answered = 0
    for seed in range(12):
        plan = random_plan(Random(seed), shape, full=seed % 2 == 0)
        answered += compare(plan, reference, seed)
        temps, raws = vectors(plan, Random(seed + 100), 20)
        expected = [oracle.run(plan, t, raw) for t, raw in zip(temps, raws, strict=True)]
        loaded, (accel, status) = built[name].generated.run_image(
            image_bytes(plan), np.array(temps, np.int32), np.array(raws, np.int32)
        )
        assert loaded == 0
        assert list(zip(accel.tolist(), status.tolist(), strict=True)) == expected
    # Constants that the device cannot invert would test one branch only.
    assert answered > 100


def test_inverse_of_a_singular_matrix_is_refused_with_a_zero_state(
    built: dict[str, Built], reference: Reference
) -> None:
    shape = built["inverse-order-2"].plan.shape
    no, k = [0, 0, 0], [INT32_MAX - 15, 0, 0]
    # All nine alike: the adjugate is zero, and so are the gains.
    alike = integer_plan(shape, [[k, k, k, no] * 3])
    # Nothing answers to z: the determinant is zero and the adjugate's last row is full.
    blind = integer_plan(shape, [[k, no, no, no, no, k, no, no, k, k, no, no]])
    for plan, status in ((alike, 0), (blind, oracle.BAD_IMAGE)):
        expected = oracle.run(plan, 0, [2**22, -(2**22), 5])
        assert expected == ([0, 0, 0], status)
        assert reference_run(reference, plan, [0], [[2**22, -(2**22), 5]]) == [expected]
        codes = np.array([0], np.int32), np.array([[2**22, -(2**22), 5]], np.int32)
        loaded, (accel, found) = built["inverse-order-2"].generated.run_image(
            image_bytes(plan), *codes
        )
        assert loaded == 0
        assert (accel[0].tolist(), int(found[0])) == expected


# ---- worked by hand ----


def test_a_value_worked_by_hand() -> None:
    # One segment of codes 0 to 2 with origin 1 and gain 2^30, so that x = -2^30, 0, 2^30.
    rows = [[0, 0]] * 12
    rows[0] = [1000, 7]  # p0 = 1000 + floor(x 7 / 2^32): 998, 1000, 1001
    rows[3] = [-5, 2]  # p0 = -6, -5, -5
    plan = integer_plan(integer_shape(order=1, output_shift=33, raw=(-3, 4)), [rows], (0, 2))
    assert (plan.segments[0].origin_code, plan.segments[0].gain) == (1, 2**30)
    assert plan.shape.raw_shift == 28  # 4 * 2^28 = 2^30 fits, 4 * 2^29 does not
    # u = 3 * 2^28. floor(998 u / 2^32) = floor(187.125) = 187; (187 - 6) >> 1 = 90.
    assert oracle.run(plan, 0, [3, 0, 0]) == ([90, 0, 0], 0)
    # Clamped: u = -3 * 2^28. floor(-1001 * 0.1875) = floor(-187.6875) = -188; -193 >> 1 = -97.
    assert oracle.run(plan, 9, [-7, 0, 0]) == ([-97, 0, 0], oracle.TEMP_HIGH | oracle.RAW_RANGE)
    temps, raws = [0, 9], [[3, 0, 0], [-7, 0, 0]]
    assert model_run(plan, temps, raws) == [([90, 0, 0], 0), ([-97, 0, 0], 6)]


def test_saturation_worked_by_hand() -> None:
    # Order 0, output_shift 28: a = (n u + b 2^32 + 2^27) >> 28.
    rows = [[0]] * 12
    rows[3], rows[7], rows[11] = [2**27], [-(2**27)], [-(2**27) - 1]
    plan = integer_plan(integer_shape(order=0, output_shift=28), [rows])
    # 2^27 2^4 = 2^31 does not fit; -2^31 does; -2^31 - 16 does not.
    assert model_run(plan, [0], [[1, 2, 3]]) == [([INT32_MAX, INT32_MIN, INT32_MIN], 8)]
    rows[3], rows[11] = [2**27 - 1], [-(2**27)]
    plan = integer_plan(integer_shape(order=0, output_shift=28), [rows])
    assert model_run(plan, [0], [[1, 2, 3]]) == [([2**31 - 16, INT32_MIN, INT32_MIN], 0)]
