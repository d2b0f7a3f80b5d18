"""WP on triax_imu.c: all of it is proven from what is proven for each triad, and no mistake is."""

from __future__ import annotations

import random
import re
from dataclasses import replace
from pathlib import Path

import pytest

from plans import COVERING, INT32_MAX, INT32_MIN, integer_shape, random_plan
from triaxcal.codegen.annotations import (
    imu_loader_not_covered,
    imu_not_covered,
    without_annotations,
)
from triaxcal.codegen.imu import annotated_imu, delivered_imu
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify import wp, wp_imu
from triaxcal.verify.wp_texts import contracts_of, overlooked, statements_of
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.test_wp_terms import plan_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
ANY = (INT32_MIN, INT32_MAX)


def gyro_of(shape: Shape) -> Shape:
    return replace(shape, gyro=True)


PAIRS = {
    "24 bits": (integer_shape(order=3), gyro_of(integer_shape(order=2))),
    "two segments, saturating": (
        integer_shape(order=2, segments=2, raw=ANY),
        gyro_of(integer_shape(output_shift=30, raw=ANY)),
    ),
    "inverse": (COVERING["inverse-order-2"], gyro_of(integer_shape(order=1, segments=2))),
    "quadratic terms": (integer_shape(quadratic=True), gyro_of(integer_shape(order=0))),
    "dT/dt": (replace(integer_shape(order=1), rate=True), gyro_of(integer_shape(order=1))),
    "sums of high words": (
        integer_shape(order=0, high_words=True, raw=(-8_000_000, 8_200_000)),
        gyro_of(integer_shape(order=1)),
    ),
}
"""Shapes of accelerometer and gyro."""
APART = {"two segments, saturating", "quadratic terms"}
"""Pairs whose gyro has a thermometer of its own."""
NEITHER, SATURATING, INVERSE = (list(PAIRS)[i] for i in (0, 1, 2))
FILES = ("specification.h", "opaque.h")


def plans(name: str) -> tuple[Plan, Plan]:
    """Constants that WP does not read."""
    accel, gyro = PAIRS[name]
    made = accel.inverse is not None or accel.quadratic
    return random_plan(random.Random(1), accel) if made else plan_of(accel), plan_of(gyro)


def texts_of(name: str, folder: Path) -> dict[str, str]:
    return wp_imu.write_texts(folder, *plans(name), two_thermometers=name in APART)


def place_of(name: str, folder: Path) -> wp.Place:
    return wp_imu.place_of(folder, *plans(name), two_thermometers=name in APART)


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(PAIRS))
def test_every_goal_is_proven(tmp_path: Path, name: str) -> None:
    assert not imu_not_covered(*PAIRS[name])
    texts, place = texts_of(name, tmp_path), place_of(name, tmp_path)
    goals: dict[str, dict[str, str]] = {}
    for part in wp_imu.parts_of(place, texts):
        goals |= wp.goals_of(place, part)
    assert [goal for goal, found in goals.items() if not found["prover"]] == []
    proven = {"lemmas", "set_temperature", "apply"}
    loader = set() if imu_loader_not_covered(*PAIRS[name]) else {"calib_load"}
    assert {goal["function"] for goal in goals.values()} == proven | loader
    assert sum(wp.SMOKE in goal for goal in goals) >= 2 * len(loader | proven - {"lemmas"})


@pytest.mark.parametrize("opaque", [False, True])
@pytest.mark.parametrize("name", list(PAIRS))
def test_what_a_caller_takes_is_what_is_proven(name: str, opaque: bool) -> None:
    """Contracts are those of the routine's own text, and their words have the same meaning."""
    loader = not imu_loader_not_covered(*PAIRS[name])
    for plan in plans(name):
        word = wp_imu.word_of(plan)
        known = statements_of(specification(plan, opaque=False))
        routine = annotated_routine(plan)
        assert not [n for n in known if n.startswith(word)]
        taken = wp_imu.interface(plan, loader=loader, opaque=opaque)
        own = re.sub(rf"\b{word}(?=\w+[({{])", "", taken)
        block, *contracts = re.findall(r"/\*@.*?\*/\n[^/]*", own, re.DOTALL)
        assert len(contracts) == (4 if loader else 2)
        for contract in contracts:
            assert re.search("ensures", contract)
            assert contract.strip().removesuffix(";") + "\n{" in routine
        assert not re.search(r"\b(lemma|axiom|admit)\b", taken)
        for found, statement in statements_of(block).items():
            head = re.split(r" reads | = ", statement)[0]
            assert known[found] == statement or known[found].startswith(head)
            assert known[found] == statement or head == statement or " reads " in statement


@pytest.mark.parametrize("name", list(PAIRS))
def test_nothing_is_taken_without_a_proof(tmp_path: Path, name: str) -> None:
    texts = texts_of(name, tmp_path)
    known, opaque = (set(re.findall(r"lemma (\w+)", texts[file])) for file in FILES)
    assert len(opaque) >= 9
    assert opaque <= known
    loader = not imu_loader_not_covered(*PAIRS[name])
    arguments = texts["triax_imu.c"], "triax_imu", *(texts[file] for file in FILES)
    assert overlooked(*arguments, loader=loader) == []
    without = arguments[0].replace("/*@ requires", "/* requires", 1)
    found = overlooked(without, *arguments[1:], loader=loader)
    assert found == ["no contract of set_temperature"]


@pytest.mark.parametrize("name", list(PAIRS))
def test_annotations_are_comments_only(name: str) -> None:
    full, delivered = (
        made(*plans(name), two_thermometers=name in APART)["triax_imu.c"]
        for made in (annotated_imu, delivered_imu)
    )
    assert "assert" in full
    assert "assert" not in delivered
    assert "ghost" not in delivered
    assert without_annotations(full) == without_annotations(delivered)
    assert "@" not in without_annotations(full)
    contracts = contracts_of(delivered, "triax_imu")
    assert all(contracts[function] for function in ("set_temperature", "apply"))
    assert bool(contracts["calib_load"]) == (not imu_loader_not_covered(*PAIRS[name]))


def test_what_is_not_covered_has_no_contracts() -> None:
    accel, gyro = PAIRS[NEITHER]
    quadratic = integer_shape(quadratic=True, raw=(-(2**31), 2**31 - 1))
    assert imu_not_covered(accel, gyro) == imu_loader_not_covered(accel, gyro) == ""
    reason = "quadratic terms of 32-bit raw codes (accelerometer)"
    assert imu_not_covered(quadratic, gyro) == reason
    inverse = gyro_of(COVERING["inverse-order-2"])
    assert imu_not_covered(accel, inverse) == "a gyro in the inverse form"
    sixth = gyro_of(integer_shape(order=6))
    assert imu_loader_not_covered(accel, sixth) == "functions of order 6 and above (gyro)"
    made = random_plan(random.Random(1), quadratic), plan_of(gyro)
    delivered = delivered_imu(*made, two_thermometers=False)
    assert "/*@" not in delivered["triax_imu.c"]


C = "triax_imu.c"
FAULTS = {
    "the code of the other thermometer": (
        SATURATING, C, "set_temperature", "gyro_calib, gyro_temp_code)",
        "gyro_calib, accel_temp_code)",
    ),
    "no bits of the gyro": (
        NEITHER, C, "set_temperature", " | (gyro_status * TRIAX_IMU_GYRO_STATUS)", ""
    ),
    "the gyro is not set": (
        NEITHER, C, "set_temperature",
        "triax_gyro_set_temperature(&state->gyro, gyro_calib, temp_code)", "TRIAX_STATUS_OK",
    ),
    "a word written behind both": (
        NEITHER, C, "set_temperature", "    return", "    state->accel.row[2][3] = 0;\n    return"
    ),
    "a status that is not told": (
        INVERSE, C, "set_temperature", "return accel_status |", "return (accel_status & 3u) |"
    ),
    "raw codes for the force": (
        NEITHER, C, "apply", "raw_gyro, accel, rate", "raw_gyro, raw_accel, rate"
    ),
    "codes of the other triad": (
        NEITHER, C, "apply", "raw_gyro, accel, rate", "raw_accel, accel, rate"
    ),
    "bits in one place": (
        NEITHER, C, "apply", "gyro_status * TRIAX_IMU_GYRO_STATUS", "gyro_status * 1u"
    ),
    "and for or": (NEITHER, C, "apply", "return accel_status |", "return accel_status &"),
    "a result written over": (
        NEITHER, C, "apply", "    return", "    accel[1] = rate[1];\n    return"
    ),
    "the gyro is not checked first": (
        NEITHER, C, "calib_load", "triax_gyro_calib_check(&image[accel_size], gyro_size)",
        "TRIAX_STATUS_OK",
    ),
    "a file's gyro without its identity": (
        NEITHER, C, "calib_load", "gyro_size = TRIAX_GYRO_FILE_SIZE",
        "gyro_size = TRIAX_GYRO_IMAGE_SIZE",
    ),
    "the accelerometer's part for both": (
        NEITHER, C, "calib_load", "load(gyro_calib, &image[accel_size]",
        "load(gyro_calib, &image[0]",
    ),
    "files are refused": (
        NEITHER, C, "calib_load", "(size == TRIAX_IMU_FILE_SIZE) || ", ""
    ),
    "the accelerometer is not read": (
        NEITHER, C, "calib_load", "triax_calib_load(accel_calib, image, accel_size)",
        "triax_calib_check(image, accel_size)",
    ),
    "results that may lie over the gyro's codes": (
        NEITHER, C, "", "    requires \\separated(accel + (0 .. 2), raw_gyro + (0 .. 2)) &&",
        "    requires",
    ),
    "a temperature clamped at one end": (
        NEITHER, "opaque.h", "set_temperature", "gyro_clamp(code, c->temp_min_code",
        "gyro_clamp(code, c->temp_max_code",
    ),
    "a row of another axis": (
        NEITHER, "opaque.h", "apply", "gyro_result(&t->row[i][0]", "gyro_result(&t->row[0][0]"
    ),
    "flags of two axes": (
        NEITHER, "opaque.h", "apply", "accel_raw_status(raw[0], raw[1], raw[2])",
        "accel_raw_status(raw[0], raw[1], raw[1])",
    ),
    "a gyro's part of the accelerometer's size": (
        NEITHER, "opaque.h", "calib_load", "size - accel_part(size))", "accel_part(size))"
    ),
    "three words make a row": (
        NEITHER, "specification.h", "gyro_result_still", "words_kept{P,M}(r, 4) ==> gyro_result{P}",
        "words_kept{P,M}(r, 3) ==> gyro_result{P}",
    ),
    "constants without the terms": (
        NEITHER, "specification.h", "gyro_calib_still",
        "gyro_segments_kept{P,M}(c) && gyro_terms_kept{P,M}(c);", "gyro_segments_kept{P,M}(c);",
    ),
}  # fmt: skip
"""Pair, text that has the mistake, function or lemma, what is replaced behind it, and by what."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(tmp_path: Path, name: str) -> None:
    pair, file, of, old, new = FAULTS[name]
    texts, place = texts_of(pair, tmp_path), place_of(pair, tmp_path)
    start = texts[file].index(f"_imu_{of}(") if file == C and of else 0
    before, text = texts[file][:start], texts[file][start:]
    assert old in text
    (tmp_path / file).write_text(before + text.replace(old, new, 1), encoding="utf-8")
    if file == "specification.h":
        part = wp.Part((), file, (f"-wp-prop={of}",))
    else:
        *_, functions = wp_imu.parts_of(place, texts)
        part = replace(functions, functions=(of or "apply",))
    assert wp.is_proven(place, part, 5) is False


@PROVERS
@pytest.mark.slow
def test_a_contradiction_is_seen(tmp_path: Path) -> None:
    texts, place = texts_of(NEITHER, tmp_path), place_of(NEITHER, tmp_path)
    old = "requires accel_usable(&state->accel) &&"
    assert old in texts[C]
    text = texts[C].replace(old, "requires 1 == 2 && accel_usable(&state->accel) &&")
    (tmp_path / C).write_text(text, encoding="utf-8")
    *_, functions = wp_imu.parts_of(place, texts)
    goals = wp.goals_of(place, replace(functions, functions=("apply",)))
    failed = [goal for goal, found in goals.items() if not found["prover"]]
    assert any("apply_wp_smoke_default_requires" in goal for goal in failed)
