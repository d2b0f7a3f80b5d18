"""The cross-check: which vectors it asks, and that it refuses at the first difference."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oracle
from builds import Built, write_generated
from plans import COVERING, GOLDEN, INT32_MAX, INT32_MIN
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.crosscheck import (
    RANDOM_VECTORS,
    VectorSet,
    cross_check,
    python_routine,
    vector_sets,
)
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.routines import Answers, Generated, Reference, start_generated
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import prove

NAMES = [
    "every temperature code", "boundaries", "borders of rounding", "random in range",
    "random int32",
]  # fmt: skip


@pytest.fixture(scope="module")
def sets() -> dict[str, list[VectorSet]]:
    return {name: vector_sets(plan, random_vectors=20_000) for name, plan in GOLDEN.items()}


def by_name(sets: list[VectorSet]) -> dict[str, VectorSet]:
    return {v.name: v for v in sets}


# ---- which vectors ----


def test_a_delivery_asks_a_million_random_vectors_of_either_kind() -> None:
    assert RANDOM_VECTORS == 1_000_000
    lengths = {v.name: len(v.temp) for v in vector_sets(GOLDEN["direct-checked"])}
    assert lengths["random in range"] == lengths["random int32"] == 1_000_000


@pytest.mark.parametrize("name", GOLDEN)
def test_every_temperature_code_meets_every_corner(
    sets: dict[str, list[VectorSet]], name: str
) -> None:
    plan = GOLDEN[name]
    low, high = plan.shape.raw_min, plan.shape.raw_max
    lattice = by_name(sets[name])["every temperature code"]
    codes = np.arange(plan.temp_min_code - 2, plan.temp_max_code + 3)
    assert np.array_equal(np.unique(lattice.temp), codes)
    at_corner = np.isin(lattice.raw, (low, high)).all(axis=1)
    corners = np.column_stack([lattice.temp, lattice.raw])[at_corner]
    assert len(np.unique(corners, axis=0)) == 8 * len(codes)
    inside = (lattice.raw > low) & (lattice.raw < high)
    assert inside.any()


@pytest.mark.parametrize("name", GOLDEN)
def test_boundaries_hold_every_limit_and_its_neighbours(
    sets: dict[str, list[VectorSet]], name: str
) -> None:
    plan = GOLDEN[name]
    grid = by_name(sets[name])["boundaries"]
    temps = {INT32_MIN, -1, 0, 1, INT32_MAX}
    for edge in (
        plan.temp_min_code,
        plan.temp_max_code,
        *(s.first_code for s in plan.segments),
        *(s.origin_code for s in plan.segments),
    ):
        temps |= {edge - 1, edge, edge + 1}
    raws = {INT32_MIN, -1, 0, 1, INT32_MAX}
    for edge in (plan.shape.raw_min, plan.shape.raw_max):
        raws |= {c for c in (edge - 1, edge, edge + 1) if INT32_MIN <= c <= INT32_MAX}
    assert set(grid.temp.tolist()) == temps
    for axis in range(3):
        assert set(grid.raw[:, axis].tolist()) == raws
    assert len(grid.temp) == len(temps) * len(raws) ** 3


@pytest.mark.parametrize("name", GOLDEN)
def test_random_vectors_fill_their_ranges(sets: dict[str, list[VectorSet]], name: str) -> None:
    plan = GOLDEN[name]
    inside = by_name(sets[name])["random in range"]
    assert plan.temp_min_code <= inside.temp.min() < inside.temp.max() <= plan.temp_max_code
    low, high = plan.shape.raw_min, plan.shape.raw_max
    assert low <= inside.raw.min() < inside.raw.max() <= high
    anything = by_name(sets[name])["random int32"]
    for codes, ends in (
        (inside.temp, (plan.temp_min_code, plan.temp_max_code)),
        (inside.raw, (low, high)),
        (anything.temp, (INT32_MIN, INT32_MAX)),
        (anything.raw, (INT32_MIN, INT32_MAX)),
    ):
        # n uniform codes miss an outer 20/n with a probability of e^-20.
        outer = (ends[1] - ends[0]) * 20 / len(np.unique(codes))
        assert codes.min() < ends[0] + outer
        assert codes.max() > ends[1] - outer
    assert len(np.unique(anything.temp)) > 20_000 / 17
    again = by_name(vector_sets(plan, random_vectors=20_000))
    for v in (inside, anything):
        assert np.array_equal(again[v.name].temp, v.temp)
        assert np.array_equal(again[v.name].raw, v.raw)


@pytest.mark.parametrize("name", GOLDEN)
def test_the_python_routine_is_the_oracle(sets: dict[str, list[VectorSet]], name: str) -> None:
    plan = GOLDEN[name]
    routine = python_routine(plan)
    for v in sets[name]:
        chosen = np.random.default_rng(len(v.temp)).integers(0, len(v.temp), 60)
        accel, status = routine(v.temp[chosen], v.raw[chosen])
        for i, k in enumerate(chosen):
            expected = oracle.run(plan, int(v.temp[k]), v.raw[k].tolist())
            assert (accel[i].tolist(), int(status[i])) == expected


# ---- agreement ----


@pytest.mark.parametrize("name", GOLDEN)
def test_three_implementations_agree(
    built: dict[str, Built], reference: Reference, sets: dict[str, list[VectorSet]], name: str
) -> None:
    b = built[name]
    check = cross_check(b.plan, sets[name], b.generated, reference.routine(b.image), b.image)
    # With sums of high words one in eight samples is on a border: there is no set of them.
    names = [n for n in NAMES if not (b.plan.shape.high_words and n == "borders of rounding")]
    assert list(check.vectors) == names
    assert check.total == sum(len(v.temp) for v in sets[name])
    assert 0.4 < check.largest_error_lsb <= prove(b.plan).lsb


def test_flags_of_every_kind_are_among_the_answers(sets: dict[str, list[VectorSet]]) -> None:
    seen = set()
    for name, plan in GOLDEN.items():
        routine = python_routine(plan)
        for v in sets[name][1:]:
            seen |= set(np.unique(routine(v.temp, v.raw)[1]).tolist())
    for flag in (1, 2, 4, 8, 1 | 4, 2 | 4, 1 | 4 | 8, 2 | 4 | 8):
        assert flag in seen
    assert 0 in seen


# ---- disagreement ----


def parse(refusal: RefusedError) -> tuple[int, list[int], list[int], int, list[int], int]:
    """Input and both outputs, read back from the message."""
    numbers = r"\[([-\d, ]+)\] status (\d+)"
    found = re.search(
        rf"temp_code (-?\d+), raw_code \[([-\d, ]+)\]: .* gives {numbers}; expected {numbers};",
        str(refusal),
    )
    assert found is not None, str(refusal)

    def triple(text: str) -> list[int]:
        return [int(n) for n in text.split(",")]

    temp, raw, out, status, expected, good = found.groups()
    return int(temp), triple(raw), triple(out), int(status), triple(expected), int(good)


def test_a_corrupted_constant_is_refused(
    built: dict[str, Built],
    reference: Reference,
    sets: dict[str, list[VectorSet]],
    tmp_path: Path,
) -> None:
    b = built["direct-checked"]
    write_generated(b.plan, tmp_path)
    constants = tmp_path / "triax_calib.c"
    text = constants.read_text(encoding="utf-8")
    assert text.count("-1223585409,") == 1  # Nyy
    constants.write_text(text.replace("-1223585409,", "-1223585408,"), encoding="utf-8")
    wrong = Generated(start_generated(tmp_path, tmp_path).load())
    with pytest.raises(RefusedError) as refusal:
        cross_check(
            b.plan,
            sets["direct-checked"],
            wrong,
            reference.routine(b.image),
            b.image,
        )
    assert "generated C gives" in str(refusal.value)
    assert "of 65536 vectors tried together differ: do not use this build, report it" in str(
        refusal.value
    )
    temp, raw, out, status, expected, good = parse(refusal.value)
    assert oracle.run(b.plan, temp, raw) == (expected, good)
    # One place of Nyy is u_y / 2^35 LSB: the wrong answer differs in y alone, by one.
    assert [o - e for o, e in zip(out, expected, strict=True)] in ([0, 1, 0], [0, -1, 0])
    assert status == good


def test_a_fault_in_the_routine_is_refused(
    built: dict[str, Built],
    reference: Reference,
    sets: dict[str, list[VectorSet]],
    tmp_path: Path,
) -> None:
    b = built["direct-left-justified-piecewise"]
    write_generated(b.plan, tmp_path)
    routine = tmp_path / "triax_comp.c"
    text = routine.read_text(encoding="utf-8")
    assert text.count("code >= calib->segment[i]") == 1
    routine.write_text(text.replace("code >= calib", "code > calib"), encoding="utf-8")
    wrong = Generated(start_generated(tmp_path, tmp_path).load())
    with pytest.raises(RefusedError) as refusal:
        cross_check(b.plan, sets[b.folder.name], wrong, reference.routine(b.image), b.image)
    temp, raw, out, status, expected, good = parse(refusal.value)
    assert temp in [s.first_code for s in b.plan.segments[1:]]
    assert oracle.run(b.plan, temp, raw) == (expected, good)
    assert out != expected
    assert status == good


def test_a_wrong_reference_is_refused_as_such(
    built: dict[str, Built], reference: Reference, sets: dict[str, list[VectorSet]]
) -> None:
    b = built["inverse-saturating"]
    good = reference.routine(b.image)

    lattice = sets["inverse-saturating"][0]
    temp, raw = lattice.temp[190147], lattice.raw[190147]

    def wrong(temps: np.ndarray, raws: np.ndarray) -> Answers:
        accel, status = good(temps, raws)
        status[(temps == temp) & (raws == raw).all(axis=1)] ^= 8
        return accel, status

    with pytest.raises(RefusedError, match="reference C gives") as refusal:
        cross_check(b.plan, sets["inverse-saturating"], b.generated, wrong, b.image)
    assert "1 of 65536 vectors tried together differ" in str(refusal.value)
    assert "cross-check, vector 190147 of 'every temperature code'" in str(refusal.value)
    _, _, found, status, expected, good_status = parse(refusal.value)
    assert found == expected
    assert status == good_status ^ 8


def test_an_image_of_other_constants_is_refused(
    built: dict[str, Built], reference: Reference, sets: dict[str, list[VectorSet]]
) -> None:
    b = built["direct-checked"]
    segment = b.plan.segments[0]
    coefficients = segment.coefficients.copy()
    coefficients[11, 0] += 8
    other = replace(b.plan, segments=(replace(segment, coefficients=coefficients),))
    with pytest.raises(RefusedError, match="generated C with the image gives"):
        cross_check(
            b.plan,
            sets["direct-checked"],
            b.generated,
            reference.routine(b.image),
            image_bytes(other),
        )


def test_an_image_that_does_not_load_is_refused(
    built: dict[str, Built], reference: Reference, sets: dict[str, list[VectorSet]]
) -> None:
    b = built["direct-checked"]
    with pytest.raises(RefusedError, match="triax_calib_load: refused its own image"):
        cross_check(
            b.plan,
            sets["direct-checked"],
            b.generated,
            reference.routine(b.image),
            b.image[:-1] + bytes([b.image[-1] ^ 1]),
        )


def test_a_fault_of_the_integer_model_is_refused(
    built: dict[str, Built], reference: Reference, sets: dict[str, list[VectorSet]]
) -> None:
    """The two C routines alike, Python apart: the plan given to Python has another constant."""
    b = built["direct-checked"]
    segment = b.plan.segments[0]
    coefficients = segment.coefficients.copy()
    coefficients[0, 0] += 1
    other: Plan = replace(b.plan, segments=(replace(segment, coefficients=coefficients),))
    with pytest.raises(RefusedError, match="generated C gives"):
        cross_check(
            other,
            sets["direct-checked"],
            b.generated,
            reference.routine(b.image),
            b.image,
        )


@pytest.mark.long
def test_covering_shapes_agree_on_random_int32(
    built: dict[str, Built], reference: Reference
) -> None:
    for name in COVERING:
        b = built[name]
        rng = np.random.default_rng(7)
        temp = rng.integers(INT32_MIN, INT32_MAX, 4000, dtype=np.int32, endpoint=True)
        raw = rng.integers(INT32_MIN, INT32_MAX, (4000, 3), dtype=np.int32, endpoint=True)
        for a, c in zip(
            b.generated.run(temp, raw), reference.routine(b.image)(temp, raw), strict=True
        ):
            assert np.array_equal(a, c), name
