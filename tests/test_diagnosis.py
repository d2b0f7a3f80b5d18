"""A cause is named with its size, what data cannot tell is one answer, the command says both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from diagnosis_units import simulated
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.fitted import fit_folder, refuse_beyond_limits
from triaxcal.diagnosis import diagnose
from triaxcal.diagnosis.answer import MARGIN
from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Parameter
from triaxcal.readings.measurements import MeasurementSet, write_measurements
from triaxcal.unit.description import read_unit


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


def test_undone_squares_leave_in_the_checks_what_a_sound_unit_does() -> None:
    """The force in a check position is the one that the mended unit shows."""
    unit, measurements, bench = simulated("own_square", 10e-3, 2)
    best = diagnose(unit, measurements).answer[0]
    assert best.cause == "own_square"
    assert best.remaining.checks_g < 3.0 * bench.sd


def test_what_tells_is_said_for_each_of_the_answer() -> None:
    unit, measurements, _ = simulated("hysteresis", 3e-3, 2)
    found = diagnose(unit, measurements)
    assert len({s.apart for s in found.answer}) > 1
    for suspect in found.answer:
        assert found.sentence.count(suspect.apart) == 1


def test_a_cause_that_is_hardly_more_probable_is_no_verdict() -> None:
    """Within odds of 20 to 1 a sound unit is a part of the answer."""
    unit, measurements, _ = simulated("hysteresis", 3e-3, 2)
    found = diagnose(unit, measurements)
    weak = replace(found, answer=(replace(found.answer[0], log_evidence=MARGIN - 0.1),))
    assert found.doubtful
    assert "sound unit" not in found.sentence
    assert not weak.doubtful
    assert weak.sentence.startswith("perhaps hysteresis")
    assert "or a sound unit" in weak.sentence or "from a sound unit" in weak.sentence


def test_of_a_sound_unit_no_refuted_cause_is_listed() -> None:
    unit, measurements, _ = simulated("none", 0.0, 3)
    first, *table = str(diagnose(unit, measurements)).splitlines()
    assert first == "no cause is more probable than a sound unit"
    assert [line.split()[0] for line in table[2:]] == ["0.0"]


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
