"""The true cause is named; a sound unit is not accused; what data cannot tell is one answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from diagnosis_units import ARC, CAUSE_OF, simulated
from recordings import FOLDER
from triaxcal.diagnosis import diagnose
from triaxcal.readings.measurements import read_measurements
from triaxcal.unit.description import read_unit

CASES = FOLDER.parent / "cases"


@pytest.mark.parametrize(
    "fault",
    ["dwell", "misplaced", "exchanged", "half_turn", "polarity", "own_square", "hysteresis",
     "sign", "unsigned", "blocks"],
)  # fmt: skip
def test_a_fault_of_two_milli_g_is_named(fault: str) -> None:
    unit, measurements, _ = simulated(fault, 2e-3, 11)
    found = diagnose(unit, measurements)
    assert CAUSE_OF[fault] in [s.cause for s in found.answer]
    assert found.doubtful


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sound_unit_is_not_accused(seed: int) -> None:
    """Its curves have bumps, its noise is more than stated, its rig is not square."""
    unit, measurements, _ = simulated(
        "none", 0.0, seed, bump_g=0.2e-3, noise=1.5, squareness=30 * ARC
    )
    assert not diagnose(unit, measurements).doubtful


def test_the_dwell_is_named_and_its_error_measured() -> None:
    unit, measurements, bench = simulated("dwell", 5e-3, 4)
    best = diagnose(unit, measurements).answer[0]
    (row,) = bench.info["rows"]
    assert best.rows == (row + 2,)
    assert max(abs(a.value) for a in best.amplitudes) == pytest.approx(5.0, abs=0.3)


def test_an_exact_class_is_one_answer_with_what_would_tell() -> None:
    unit, measurements, _ = simulated("hysteresis", 3e-3, 2)
    found = diagnose(unit, measurements)
    assert {"hysteresis", "step"} <= {s.cause for s in found.answer}
    assert "cannot tell it from" in found.sentence
    assert found.request is not None
    assert found.request.distance > 10


def case(name: str) -> tuple[Path, object]:
    folder = CASES / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    unit = read_unit(folder)
    return diagnose(unit, read_measurements(folder / "measurements.csv", unit))


@pytest.mark.parametrize(
    ("name", "cause", "words"),
    [
        ("tilter_temp_sign", "block_temperature", "+45 for -45 degC in rows 20-25"),
        ("tilter_temp_sign9", "block_temperature", "+45 for -45 degC in rows 38-43"),
        ("tilter_half_turn", "half_turn", "outputs y and z"),
        ("tilter_own_axis_square", "own_square", "squares"),
        ("tilter_hysteresis", "hysteresis", "checks and tests differ by one bias"),
    ],
)
def test_cases(name: str, cause: str, words: str) -> None:
    found = case(name)
    assert found.answer[0].cause == cause
    assert words in found.sentence
