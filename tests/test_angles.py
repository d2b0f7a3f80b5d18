"""triax_angles: the C, its integer model, its proven error, and the angles as they really are."""

from __future__ import annotations

import ctypes
import itertools
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import exact_angles
from plans import GOLDEN
from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.codegen.angles import GeneratedAngles, render_angles
from triaxcal.codegen.angles_check import (
    FLOAT_UNITS,
    angle_vectors,
    check_angles,
    errors_units,
    exact_units,
)
from triaxcal.codegen.compiler import compile_library
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.routines import Int32Array
from triaxcal.fixedpoint import angles_proof
from triaxcal.fixedpoint.angles import (
    ARCSEC_PER_UNIT,
    QUARTER,
    ROTATION_UNITS,
    STATUS_NOT_AT_REST,
    STATUS_SECOND_ANGLE,
    TURN,
    AnglesPlan,
    angles,
)
from triaxcal.fixedpoint.angles_proof import prove_angles
from triaxcal.fixedpoint.enclosure import arc_tangent, pi, square_root
from triaxcal.model.orientation import (
    AIRCRAFT,
    INCLINOMETER,
    direction_cosines,
    gravity_direction,
)
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE, AnglesChoice

PAIRS = (ZENITH_TOOL_FACE, PITCH_ROLL)
PLAN = GOLDEN["direct-checked"]
G = 1 << PLAN.shape.output_q
LOW, HIGH = -(2**31), 2**31 - 1
BLOCK = 1_000_000


def plan_of(pair: str, **settings: float) -> AnglesPlan:
    return AnglesPlan(AnglesChoice(pair, **settings), PLAN.shape.output_q)


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ctypes.CDLL]:
    return {pair: compiled(plan_of(pair), tmp_path_factory.mktemp(pair)) for pair in PAIRS}


def compiled(plan: AnglesPlan, folder: Path, old: str = "", new: str = "") -> ctypes.CDLL:
    """triax_angles alone, with one change in its C."""
    texts = {"triax_comp.h": render_routine(PLAN)["triax_comp.h"]}
    texts |= render_angles(plan, names_of(PLAN))
    assert not old or texts["triax_angles.c"].count(old) == 1
    texts["triax_angles.c"] = texts["triax_angles.c"].replace(old or " ", new or " ")
    for name, text in texts.items():
        (folder / name).write_text(text)
    source = shipped("firmware_ref")
    sources = [folder / "triax_angles.c", source / "triax_angles_batch.c"]
    return compile_library(sources, folder / "angles.so", include=[folder, source]).load()


def triads(rows: list[list[int]]) -> Int32Array:
    return np.array(rows, np.int32)


def error_units(plan: AnglesPlan, accel: list[int], found: list[int]) -> tuple[float, float]:
    """Errors against the exact angles of these integers, modulo a turn."""
    exact = exact_angles.exact(plan.zenith, *accel)
    away = [(f - e + TURN // 2) % TURN - TURN // 2 for f, e in zip(found, exact, strict=True)]
    return float(away[0]), float(away[1])


@pytest.mark.parametrize("pair", PAIRS)
def test_the_convention_is_that_of_the_paper(pair: str) -> None:
    # A grid of angles: gravity is the last column of a rotation, and the angles come back.
    plan = plan_of(pair)
    firsts = np.radians(
        [10.0, 45.0, 90.0, 130.0, 170.0] if plan.zenith else [-80.0, -30.0, 0.0, 60.0]
    )
    seconds = np.radians(np.arange(-175.0, 180.0, 25.0))
    grid = np.array(list(itertools.product(firsts, seconds)))
    A = direction_cosines(plan.choice.kind, grid)
    assert np.allclose(A @ np.swapaxes(A, 1, 2), np.eye(3), atol=1e-15)
    assert np.allclose(np.linalg.det(A), 1.0)
    gravity = gravity_direction(plan.choice.kind, grid)
    assert np.allclose(A[:, :, 2], gravity, atol=1e-15)
    found, status = angles(plan, np.rint(gravity * G).astype(np.int64))
    assert not status.any()
    away = found * (2 * np.pi / TURN) - grid
    # Half an LSB of each component, over the sine of the least zenith: 1e-7 rad * sqrt(3).
    assert np.abs((away + np.pi) % (2 * np.pi) - np.pi).max() < 3e-7


def test_the_headers_words() -> None:
    zenith, pitch = plan_of(ZENITH_TOOL_FACE), plan_of(PITCH_ROLL)
    near = 50
    for plan, accel, first, second in (
        (zenith, [0, 0, G], 0, 0),
        (zenith, [0, 0, -G], 2 * QUARTER, 0),
        (zenith, [-G, 0, 0], QUARTER, 0),
        (zenith, [0, -G, 0], QUARTER, QUARTER),
        (zenith, [G, 0, 0], QUARTER, 2 * QUARTER),
        (zenith, [0, G, 0], QUARTER, 3 * QUARTER),
        (zenith, [0, 0, 0], 0, 0),
        (pitch, [-G, 0, 0], QUARTER, 0),
        (pitch, [G, 0, 0], -QUARTER, 0),
        (pitch, [0, 0, G], 0, 0),
        (pitch, [0, G, 0], 0, QUARTER),
        (pitch, [0, -G, 0], 0, -QUARTER),
        (pitch, [0, 0, -G], 0, -2 * QUARTER),
        (pitch, [0, 0, 0], 0, 0),
    ):
        found = angles(plan, triads([accel]).astype(np.int64))[0][0].tolist()
        assert abs(found[0] - first) <= near, accel
        assert abs((found[1] - second + TURN // 2) % TURN - TURN // 2) <= near, accel


@pytest.mark.parametrize("pair", PAIRS)
def test_c_and_python_give_the_same_bits_within_the_bound(
    pair: str, libraries: dict[str, ctypes.CDLL]
) -> None:
    check = check_angles(plan_of(pair), libraries[pair])
    assert set(check.vectors) == {
        "edges", "about 1 g", "near an axis", "every size", "random int32",
    }  # fmt: skip
    bound = check.bound.units
    # The bound adds the worst of each cause. It must hold; about half of it is reached.
    for seen, proven in zip(check.largest_units, bound, strict=True):
        assert 0.4 * float(proven) < seen <= float(proven)


@pytest.mark.parametrize("pair", PAIRS)
def test_within_the_bound_of_the_exact_angles(pair: str, libraries: dict[str, ctypes.CDLL]) -> None:
    plan = plan_of(pair)
    proven = [float(u) for u in prove_angles().units]
    values = (LOW, LOW + 1, -(1 << 30), -G, -3, -1, 0, 1, 2, G, (1 << 30) - 1, HIGH)
    rows = [list(row) for row in itertools.product(values, repeat=3)]
    rng = np.random.default_rng(9)
    rows += rng.integers(LOW, HIGH, (300, 3), endpoint=True).tolist()
    found, _ = GeneratedAngles(libraries[pair], plan).run(triads(rows))
    for accel, angle in zip(rows, found.tolist(), strict=True):
        across = accel[:2] if plan.zenith else accel[1:]
        if not any(accel):
            assert angle == [0, 0]
            continue
        if not any(across):
            assert angle[1] == 0
            away = float(angle[0]) - (0.0 if accel[2] > 0 else TURN / 2)
            assert abs(away if plan.zenith else abs(angle[0]) - QUARTER) <= proven[0]
            continue
        error = error_units(plan, accel, angle)
        assert abs(error[0]) <= proven[0], accel
        assert abs(error[1]) <= proven[1], accel


def test_the_doubles_of_the_campaign_are_good_enough() -> None:
    for pair in PAIRS:
        plan = plan_of(pair)
        for accel in angle_vectors(plan, 200).values():
            some = accel[:: max(1, len(accel) // 100)]
            across = some[:, :2] if plan.zenith else some[:, 1:]
            some = some[across.any(axis=1)]
            doubles = exact_units(plan, some)
            for row, found in zip(some.tolist(), doubles.tolist(), strict=True):
                exact = exact_angles.exact(plan.zenith, *row)
                for k in range(2):
                    away = (Fraction(found[k]) - exact[k] + TURN // 2) % TURN - TURN // 2
                    assert abs(away) < FLOAT_UNITS / 2


def test_the_oracle_knows_pi() -> None:
    digits = Fraction("3.141592653589793238462643383279502884197")
    assert abs(Fraction(exact_angles.HALF_TURN, exact_angles.ONE) - digits) < Fraction(1, 1 << 84)
    low, high = pi()
    assert low < digits + Fraction(1, 10**39)
    assert digits - Fraction(1, 10**39) < high
    assert high - low < Fraction(1, 1 << 120)


def test_enclosures_hold_what_they_should() -> None:
    for i in (1, 2, 7, 12):
        low, high = arc_tangent(Fraction(1, 1 << i))
        t = exact_angles._atan(exact_angles.ONE >> i)
        assert (
            low - Fraction(1, 1 << 84) < Fraction(t, exact_angles.ONE) < high + Fraction(1, 1 << 84)
        )
        assert 0 < high - low < Fraction(1, 1 << 120)
    low, high = square_root(Fraction(2))
    assert low**2 < 2 < high**2


def test_the_bound_is_what_was_asked() -> None:
    for units in prove_angles().units:
        assert units * Fraction(1296000, TURN) < Fraction(5, 100)


def test_the_bound_follows_the_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    sound = prove_angles().units[1]
    wrong = (*ROTATION_UNITS[:5], ROTATION_UNITS[5] + 1000, *ROTATION_UNITS[6:])
    monkeypatch.setattr(angles_proof, "ROTATION_UNITS", wrong)
    assert 999 < prove_angles().units[1] - sound < 1001
    monkeypatch.undo()
    monkeypatch.setattr(angles_proof, "QUOTIENT_UNITS", angles_proof.QUOTIENT_UNITS + 10)
    # 10 / 2^12 of 2^14 quotients, and the start that no longer fits it.
    assert prove_angles().units[1] - sound > 39
    monkeypatch.undo()
    monkeypatch.setattr(angles_proof, "PER_LENGTH", angles_proof.PER_LENGTH + (1 << 12))
    assert prove_angles().units[0] > 400
    assert prove_angles().units[1] == sound


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("316933405u", "316933415u"),
        ("83443u", "83444u"),
        ("across ^ sign", "across"),
        ("left - common", "left"),
        ("along | (0u - along)", "along"),
        ("(left >> (32u - step))", "(left >> (31u - step))"),
    ],
)
def test_faults_in_the_c_are_found(old: str, new: str, tmp_path: Path) -> None:
    plan = plan_of(ZENITH_TOOL_FACE)
    with pytest.raises(RefusedError, match="cross-check of triax_angles"):
        check_angles(plan, compiled(plan, tmp_path, old, new))


@pytest.mark.parametrize("pair", PAIRS)
def test_status_by_whole_numbers(pair: str, libraries: dict[str, ctypes.CDLL]) -> None:
    plan = plan_of(pair)
    steep = math.sin(math.radians(1.0)) * G
    rows = [[round(x * G), 0, 0] for x in (0.9499, 0.9501, 1.0499, 1.0501)]
    rows += [[0, 0, z] for z in (G, -G, round(0.94 * G), LOW, HIGH, 0)]
    for across in (round(steep) - 2, round(steep) + 2):
        rows += [[across, 0, G], [0, -across, -G], [G, 0, across], [G, across, 0]]
    rows += [[LOW, LOW, LOW], [HIGH, HIGH, HIGH], [1, 0, 0], [0, 1, 0]]
    _, found = GeneratedAngles(libraries[pair], plan).run(triads(rows))
    for (x, y, z), status in zip(rows, found.tolist(), strict=True):
        across = (x * x + y * y) if plan.zenith else (y * y + z * z)
        moved = not (0.95 * G) ** 2 <= x * x + y * y + z * z <= (1.05 * G) ** 2
        expected = STATUS_SECOND_ANGLE * (across < steep**2) + STATUS_NOT_AT_REST * moved
        assert status == expected, (x, y, z)


def test_what_is_flagged_can_be_chosen() -> None:
    plan = plan_of(ZENITH_TOOL_FACE, rest_within_g=0.2, second_from_deg=5.0)
    rows = triads([[0, round(0.08 * G), G], [0, round(0.09 * G), G], [0, 0, round(1.19 * G)]])
    _, status = angles(plan, rows.astype(np.int64))
    assert status.tolist() == [STATUS_SECOND_ANGLE, 0, STATUS_SECOND_ANGLE]


@pytest.mark.parametrize("output_q", [8, 20, 30])
def test_other_formats(output_q: int) -> None:
    plan = replace(plan_of(ZENITH_TOOL_FACE), output_q=output_q)
    one = 1 << output_q
    rows = triads([[one, 0, 0], [one, 0, one], [0, one // 2, one // 2], [0, 0, one]])
    _, status = angles(plan, rows.astype(np.int64))
    assert status.tolist() == [0, STATUS_NOT_AT_REST, STATUS_NOT_AT_REST, STATUS_SECOND_ANGLE]


def test_kinds_are_those_of_the_model() -> None:
    assert [AnglesChoice(pair).kind for pair in PAIRS] == [INCLINOMETER, AIRCRAFT]
    assert f"{ARCSEC_PER_UNIT:.4f}" == "0.0003"


def campaign_block(rng: np.random.Generator, kind: int) -> Int32Array:
    """About 1 g, near an axis at 1 g, of every size, and any int32, in turn."""
    if kind == 3:
        return rng.integers(LOW, HIGH, (BLOCK, 3), np.int32, endpoint=True)
    if kind == 2:
        anything = rng.integers(LOW, HIGH, (BLOCK, 3), np.int32, endpoint=True)
        return anything >> rng.integers(0, 31, (BLOCK, 3), dtype=np.int32)
    force = rng.normal(size=(BLOCK, 3))
    if kind == 1:
        force *= np.exp2(rng.uniform(-24.0, 0.0, (BLOCK, 3)))
    force *= rng.uniform(0.9, 1.1, (BLOCK, 1)) * G / np.linalg.norm(force, axis=1)[:, None]
    return np.rint(force).astype(np.int32)


@pytest.mark.slow
@pytest.mark.parametrize("pair", PAIRS)
def test_a_hundred_million_vectors_stay_within_the_bound(
    pair: str, libraries: dict[str, ctypes.CDLL]
) -> None:
    plan = plan_of(pair)
    generated = GeneratedAngles(libraries[pair], plan)
    proven = [float(u) for u in prove_angles().units]
    worst, seen, rows = [0.0, 0.0], 0, [[0, 0, 0]] * 2
    for number in range(100):
        accel = campaign_block(np.random.default_rng([20130531, number]), number % 4)
        error = errors_units(plan, accel, generated.run(accel)[0])
        seen += len(accel)
        for k in range(2):
            i = int(error[:, k].argmax())
            if error[i, k] > worst[k]:
                worst[k], rows[k] = float(error[i, k]), accel[i].tolist()
    assert seen == 100_000_000
    for k, row in enumerate(rows):
        assert worst[k] <= proven[k] - FLOAT_UNITS
        # The worst of all, by whole numbers.
        exact = error_units(plan, row, generated.run(triads([row]))[0][0].tolist())[k]
        assert abs(abs(exact) - worst[k]) < FLOAT_UNITS
        print(f"{plan.choice.names[k]}: {worst[k]:.2f} of {proven[k]:.2f} units at {row}")
