"""The true cause of many kinds of faults is named, and a sound unit is not accused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_units import ARC, CAUSE_OF, UNLISTED, simulated
from recordings import FOLDER
from triaxcal.diagnosis import Diagnosis, diagnose
from triaxcal.readings.measurements import MeasurementSet, read_measurements
from triaxcal.unit.description import read_unit

CASES = FOLDER.parent / "cases"


@pytest.mark.parametrize(
    "fault",
    ["dwell", "misplaced", "exchanged", "half_turn", "polarity", "own_square", "hysteresis",
     "sign", "unsigned", "blocks", "settling",
     "dwells", "squareness", "lag", "drift", "dead", "copied", "saturated", "mounting",
     "left_handed"],
)  # fmt: skip
def test_a_fault_of_two_milli_g_is_named(fault: str) -> None:
    unit, measurements, _ = simulated(fault, 2e-3, 11)
    found = diagnose(unit, measurements)
    assert CAUSE_OF[fault] in [s.cause for s in found.answer]
    assert found.clear


@pytest.mark.parametrize("fault", sorted(UNLISTED))
def test_what_is_not_in_the_list_has_no_wrong_name(fault: str) -> None:
    unit, measurements, _ = simulated(fault, 2e-3, 11)
    found = diagnose(unit, measurements)
    assert not found.clear or found.answer[0].symptom


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sound_unit_is_not_accused(seed: int) -> None:
    """Its curves have bumps, its noise is more than stated, its rig is not square."""
    unit, measurements, _ = simulated(
        "none", 0.0, seed, bump_g=0.2e-3, noise=1.5, squareness=30 * ARC
    )
    assert not diagnose(unit, measurements).clear


def case(name: str) -> Diagnosis:
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
        ("tilter_dead_axis", "dead", "output z"),
        ("tilter_hysteresis", "hysteresis", "checks and tests differ by one bias"),
    ],
)
def test_cases(name: str, cause: str, words: str) -> None:
    found = case(name)
    assert found.answer[0].cause == cause
    assert words in found.sentence


@pytest.mark.parametrize(
    ("kept", "changed"),
    [
        (lambda d: abs(d.temp_degc - 20) < 1 and d.position[0] == "T", {}),
        (lambda _d: True, {"sd_v": None, "count": None}),
        (lambda _d: True, {"voltage_v": np.zeros(3)}),
        (lambda _d: True, {"temp_degc": 20.0}),
        (lambda d: d.row % 7 != 0, {}),
    ],
    ids=["one temperature", "no statistics", "nothing measured", "one temperature stated", "gaps"],
)
def test_whatever_is_there_is_diagnosed(kept, changed) -> None:
    unit, measurements, _ = simulated("none", 0.0, 5)
    dwells = tuple(replace(d, **changed) for d in measurements.dwells if kept(d))
    assert str(diagnose(unit, MeasurementSet("m.csv", dwells)))
