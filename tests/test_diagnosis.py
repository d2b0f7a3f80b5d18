"""A cause is named with its size, what data cannot tell is one answer, the command says both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from diagnosis_units import simulated
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery import causes
from triaxcal.delivery.causes import causes_of, with_cause
from triaxcal.delivery.fitted import fit_folder, refuse_beyond_limits
from triaxcal.diagnosis import diagnose
from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Parameter
from triaxcal.diagnosis.core.readings import readings_of
from triaxcal.diagnosis.core.scales import Scales
from triaxcal.diagnosis.core.screen import log_evidence_of_tests
from triaxcal.diagnosis.core.sound import System
from triaxcal.fitting.recorded.wrong import MARGIN
from triaxcal.readings.measurements import MeasurementSet, write_measurements
from triaxcal.unit.description import UnitDescription, read_unit


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
    assert found.clear
    assert "sound unit" not in found.sentence
    assert not weak.clear
    assert weak.sentence.startswith("perhaps hysteresis")
    assert "or a sound unit" in weak.sentence or "from a sound unit" in weak.sentence


def test_of_a_sound_unit_no_refuted_cause_is_listed() -> None:
    unit, measurements, _ = simulated("none", 0.0, 3)
    first, *table = str(diagnose(unit, measurements)).splitlines()
    assert first == "no cause is more probable than a sound unit"
    assert [line.split()[0] for line in table[2:]] == ["0.0"]


def test_two_causes_at_once_are_not_named_as_one() -> None:
    unit, measurements, bench = simulated("two", 2e-3, 1)
    best = diagnose(unit, measurements).answer[0]
    assert best.cause == "together"
    assert "own-axis squares of the sensor" in best.name
    assert f"one position tilted at every temperature, {bench.info['place']}" in best.name
    assert best.spoils
    assert best.remaining.checks_g < 3.0 * bench.sd


def test_the_quick_evidence_of_test_positions_is_the_careful_one() -> None:
    unit, measurements, _ = simulated("half_turn", 0.0, 3, checks=False)
    readings = readings_of(unit, measurements)
    unused = np.zeros((len(readings), 3), dtype=np.bool_)
    unused[3:8, 1] = True
    scales = Scales(noise=1.4, tilt=40e-6)
    for some in (None, unused):
        careful = System(readings, None, some).fit(scales).log_evidence
        # Both lose 16 digits on the squares of rows that are 2 g off in 20 micro-g: 1e10.
        usual, found = log_evidence_of_tests(readings, [Scales(), scales], some)
        assert found == pytest.approx(careful, abs=1e-3)
        assert log_evidence_of_tests(readings, [Scales()], some) == pytest.approx([usual])


def test_a_cause_of_ones_own_competes() -> None:
    """It is one entry: places, what it did, and what would tell it apart."""
    spoiled = 7

    def undo(readings, amplitudes):
        own = (readings.block == 2)[:, None]
        mixed = readings.force[:, [1, 2, 0]] * amplitudes[0]
        return readings.but(outputs=readings.outputs - own * mixed)

    def places(_known):
        yield Hypothesis(
            "third block", undo, (Parameter("mixed", "%", 100.0),), change="its crosstalk"
        )

    entry = Cause(
        "block_mixed", "one block mixed", "One block's crosstalk.", places, "the block again"
    )
    unit, measurements, _ = simulated("none", 0.0, spoiled)
    third = sorted(measurements.dwells, key=lambda d: d.row)[12:18]
    rows = {d.row for d in third}
    dwells = tuple(
        replace(d, voltage_v=d.voltage_v + 0.004 * d.voltage_v[[1, 2, 0]]) if d.row in rows else d
        for d in measurements.dwells
    )
    with CAUSES.added(entry):
        found = diagnose(unit, MeasurementSet("m.csv", dwells))
    assert found.answer[0].cause == "block_mixed"
    assert found.answer[0].amplitudes[0].value == pytest.approx(0.4, abs=0.05)


def test_a_position_that_is_missing_altogether_is_refused() -> None:
    unit, measurements, _ = simulated("none", 0.0, 5)
    dwells = tuple(d for d in measurements.dwells if d.position != "TP4")
    with pytest.raises(RefusedError, match="no dwell in TP4"):
        diagnose(unit, MeasurementSet("m.csv", dwells))


def test_the_command_and_the_refusal_name_the_cause(tmp_path: Path) -> None:
    unit, measurements, _ = simulated("hysteresis", 4e-3, 3)
    folder = described(tmp_path, unit, measurements)
    done = CliRunner().invoke(main, ["diagnose", str(folder)])
    assert done.exit_code == 0
    assert "ln odds" in done.output
    assert "most probably hysteresis" in done.output
    with pytest.raises(RefusedError, match="most probably hysteresis"):
        refuse_beyond_limits(fit_folder(read_unit(folder), folder))


def described(tmp_path: Path, unit: UnitDescription, measurements: MeasurementSet) -> Path:
    """A folder below, alone there: its serial number is the others' too."""
    folder = tmp_path / "unit"
    folder.mkdir(exist_ok=True)
    (folder / "unit.toml").write_text(unit.toml)
    columns = ("position", "temp_degc", "ux_v", "uy_v", "uz_v", "count", "sd_ux_v", "sd_uy_v",
               "sd_uz_v")  # fmt: skip
    rows = [
        (d.position, d.temp_degc, *d.voltage_v.tolist(), d.count, *d.sd_v.tolist())
        for d in measurements.dwells
    ]
    write_measurements(folder / "measurements.csv", columns, rows)
    return folder


def test_squares_in_the_calibration_are_no_fault_and_hide_none(tmp_path: Path) -> None:
    unit, measurements, _ = simulated("own_square", 8e-3, 2)
    folder = described(tmp_path, unit, measurements)
    done = fit_folder(read_unit(folder), folder)
    assert done.calibration.squares is not None
    assert done.calibration.squares.included
    assert diagnose(unit, measurements).answer[0].cause == "own_square"
    assert not causes_of(unit, done.measurements, done.calibration).clear
    bad = next(d for d in measurements.dwells if d.position == "CP6")
    dwells = tuple(
        replace(d, voltage_v=d.voltage_v + np.array([2e-3, 0, 0])) if d is bad else d
        for d in measurements.dwells
    )
    described(tmp_path, unit, MeasurementSet("m.csv", dwells))
    with pytest.raises(RefusedError) as refused:
        refuse_beyond_limits(fit_folder(read_unit(folder), folder))
    assert refused.value.place.endswith(f"measurements.csv, row {bad.row}")
    assert "most probably one wrong dwell" in refused.value.found


def test_a_series_without_squares_is_told_which_key_keeps_them_out(tmp_path: Path) -> None:
    unit, measurements, _ = simulated("own_square", 8e-3, 2)
    folder = described(tmp_path, unit, measurements)
    with (folder / "unit.toml").open("a") as text:
        text.write('\n[firmware]\nterms = "linear"\n')
    with pytest.raises(RefusedError, match=r'remove \[firmware\] terms = "linear"'):
        refuse_beyond_limits(fit_folder(read_unit(folder), folder))


def test_what_no_cause_explains_keeps_its_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    unit, measurements, _ = simulated("dwell", 5e-3, 4)
    refusal = RefusedError(measurements.source, "misses", expected="1 mg", remedy="measure again")
    found = diagnose(unit, measurements)
    best = replace(found.answer[0], cause="unknown", symptom=True)
    monkeypatch.setattr(causes, "causes_of", lambda *_: replace(found, answer=(best,)))
    told = with_cause(refusal, unit, measurements, contradiction=True)
    assert told.remedy.startswith("measure again; no cause of the list")


def test_a_folder_is_diagnosed_as_its_unit_is(tmp_path: Path) -> None:
    unit, measurements, _ = simulated("dwell", 5e-3, 4)
    folder = described(tmp_path, unit, measurements)
    found = triaxcal.diagnose(folder)
    assert found.sentence == triaxcal.diagnose(triaxcal.read_unit(folder)).sentence
    assert triaxcal.diagnose(str(folder)).answer[0].cause == "dwell"


def test_without_check_dwells_squares_and_squareness_are_one_answer() -> None:
    unit, measurements, _ = simulated("other_squares", 2e-3, 1, checks=False)
    assert {"squareness", "other_squares"} <= {s.cause for s in diagnose(unit, measurements).answer}
    unit, measurements, _ = simulated("squareness", 2e-3, 1)
    assert [s.cause for s in diagnose(unit, measurements).answer] == ["squareness"]
