"""The true cause is named; a sound unit is not accused; what data cannot tell is one answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from diagnosis_units import ARC, CAUSE_OF, simulated
from recordings import FOLDER
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.fitted import fit_folder, refuse_beyond_limits
from triaxcal.diagnosis import diagnose
from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Parameter
from triaxcal.readings.measurements import MeasurementSet, read_measurements, write_measurements
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


def test_a_cause_of_ones_own_competes() -> None:
    """It is one entry: places, what it did, and what would tell it apart."""
    spoiled = 7

    def undo(readings, amplitudes):
        own = (readings.block == 2)[:, None]
        return readings.but(outputs=readings.outputs - own * readings.force * amplitudes[0])

    def places(_known):
        yield Hypothesis("third block", undo, (Parameter("gain", "%", 100.0),), change="its gain")

    entry = Cause("block_gain", "gain of one block", "One block's gain.", places, "the block again")
    unit, measurements, _ = simulated("none", 0.0, spoiled)
    third = sorted(measurements.dwells, key=lambda d: d.row)[12:18]
    rows = {d.row for d in third}
    dwells = tuple(
        replace(d, voltage_v=d.voltage_v * 1.004) if d.row in rows else d
        for d in measurements.dwells
    )
    with CAUSES.added(entry):
        found = diagnose(unit, MeasurementSet("m.csv", dwells))
    assert found.answer[0].cause == "block_gain"
    assert found.answer[0].amplitudes[0].value == pytest.approx(0.4, abs=0.05)


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


def test_a_position_that_is_missing_altogether_is_refused() -> None:
    unit, measurements, _ = simulated("none", 0.0, 5)
    dwells = tuple(d for d in measurements.dwells if d.position != "TP4")
    with pytest.raises(RefusedError, match="no dwell in TP4"):
        diagnose(unit, MeasurementSet("m.csv", dwells))


def test_the_command_and_the_refusal_name_the_cause(tmp_path: Path) -> None:
    unit, measurements, _ = simulated("hysteresis", 4e-3, 3)
    (tmp_path / "unit.toml").write_text(unit.toml)
    columns = ("position", "temp_degc", "ux_v", "uy_v", "uz_v", "count", "sd_ux_v", "sd_uy_v",
               "sd_uz_v")  # fmt: skip
    rows = [
        (d.position, d.temp_degc, *d.voltage_v.tolist(), d.count, *d.sd_v.tolist())
        for d in measurements.dwells
    ]
    write_measurements(tmp_path / "measurements.csv", columns, rows)
    done = CliRunner().invoke(main, ["diagnose", str(tmp_path)])
    assert done.exit_code == 0
    assert "ln odds" in done.output
    assert "most probably hysteresis" in done.output
    with pytest.raises(RefusedError, match="most probably hysteresis"):
        refuse_beyond_limits(fit_folder(read_unit(tmp_path), tmp_path))
