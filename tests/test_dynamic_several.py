"""Several recordings of one IMU in one solution."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dynamic_cases import SHORT_MOVES, UNIT_TOML, changed, held, sheet, table_of, write_unit
from dynamic_judge import true_constants
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.several import BREAK_S, joined_recordings, read_recordings
from triaxcal.dynamic.temperatures import recorded_temperatures
from triaxcal.dynamic.unit import calibrate_unit
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting
from triaxcal.simulation.imu_truth import ImuTruth

SEVERAL = UNIT_TOML.replace('recording = "recording.csv"\n', "").replace(
    "[noise]",
    '[[dynamic.recording]]\nfile = "recording.csv"\n[[dynamic.recording]]\nfile = "b.csv"\n[noise]',
)


@cache
def both() -> tuple[ImuTruth, tuple[ImuRecording, ImuRecording]]:
    """Two recordings of half a minute an axis."""
    truth = draw_truth(MEMS, 1)
    motion = ImuMotion(tuple(Mounting(SHORT_MOVES, 12.0) for _ in range(3)))
    one, two = (held(simulate_imu(truth, motion, 50.0, seed)) for seed in (1, 2))
    return truth, (one, two)


def folder_of_two(tmp_path: Path, toml: str = SEVERAL) -> Path:
    one, two = (table_of(recording) for recording in both()[1])
    unit = write_unit(tmp_path / "IMU", one, toml)
    write_unit(tmp_path / "other", two, toml)
    (tmp_path / "other" / "recording.csv").rename(unit / "b.csv")
    return unit


def refusal(folder: Path) -> str:
    with pytest.raises(RefusedError) as refused:
        read_recordings(read_dynamic(folder))
    return str(refused.value).replace(str(folder), "IMU")


def test_constants_of_two_recordings_are_better_by_root_two() -> None:
    truth, recordings = both()
    alone = calibrate_dynamic(recordings[0], sheet(truth))
    joined = calibrate_dynamic(joined_recordings(list(recordings)), sheet(truth))
    assert len(joined.survey.sections) == 2
    assert len(joined.survey.stages) == 6
    n = 21
    gain = alone.sd[:n] / joined.sd[:n]
    # Twice the information; the prior and the unknown north have a little as well.
    assert (gain > 1.35).all()
    assert (gain < 1.47).all()
    true = true_constants(truth)
    names = [state.name for block in BASE for state in block.states]
    z = (joined.p[:n] - [true[name] for name in names]) / joined.sd[:n]
    assert np.abs(z).max() < 4.0  # 21 values: once in 750 by chance
    assert float(z @ z) < 60.0  # far looser than chi-square of 21: they correlate


def test_two_files_are_read_one_after_the_other(tmp_path: Path) -> None:
    unit = folder_of_two(tmp_path)
    read = read_recordings(read_dynamic(unit)).all()
    one, two = (recording.all() for recording in both()[1])
    assert len(read) == len(one) + len(two)
    assert np.array_equal(read.rate, np.concatenate([one.rate, two.rate]))
    later = read.time_s[len(one) :] - read.time_s[len(one) - 1] - BREAK_S
    assert np.allclose(later, two.time_s - two.time_s[0], atol=1e-9)


def test_a_unit_of_two_recordings_is_calibrated(tmp_path: Path) -> None:
    done = calibrate_unit(folder_of_two(tmp_path))
    assert done.unit.recording_words == "recording.csv, b.csv"
    assert len(done.unit.inputs) == 3
    assert len(done.result.survey.stages) == 6


def test_a_recording_that_is_missing_is_named(tmp_path: Path) -> None:
    unit = folder_of_two(tmp_path)
    (unit / "b.csv").unlink()
    assert refusal(unit).startswith("IMU/b.csv: no such file; ")


def test_a_thermometer_without_the_noise_that_it_has_elsewhere_is_stuck() -> None:
    one, two = both()[1]
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(one.all()))
    reads = (
        changed(one, temp_degc=40.0 + noise),
        changed(two, temp_degc=np.full(len(two.all()), 20.0)),
    )
    with pytest.raises(RefusedError, match=r"reads the same for .* is stuck"):
        recorded_temperatures(joined_recordings(list(reads)))
    coarse = changed(one, temp_degc=40.0 + 0.5 * (noise > 0.05)), reads[1]
    assert recorded_temperatures(joined_recordings(list(coarse))) is not None


def test_recordings_of_two_rates_are_refused(tmp_path: Path) -> None:
    unit = folder_of_two(tmp_path)
    rows = (unit / "b.csv").read_text(encoding="utf-8").splitlines()
    (unit / "b.csv").write_text("\n".join([rows[0], *rows[1::2]]), encoding="utf-8")
    assert refusal(unit) == (
        "IMU/b.csv: 25 samples a second, and 50 in IMU/recording.csv; expected recordings of one "
        "sampling rate; record all of them in the same way"
    )


def test_a_stated_temperature_is_that_of_the_recording(tmp_path: Path) -> None:
    toml = SEVERAL.replace('"recording.csv"\n', '"recording.csv"\ntemp_degc = 20\n')
    toml = toml.replace('"b.csv"\n', '"b.csv"\ntemp_degc = -10\n')
    degc = read_recordings(read_dynamic(folder_of_two(tmp_path, toml))).all().temp_degc
    assert degc is not None
    assert set(degc) == {20.0, -10.0}
    assert degc[0] == 20.0


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('file = "b.csv"', 'name = "b.csv"', "a table [[dynamic.recording]] with file"),
        ('file = "b.csv"', 'file = "recording.csv"', "each file once"),
        ('file = "b.csv"', 'file = "b.csv"\ntemp_degc = 900', "a table [[dynamic.recording]]"),
        ('file = "b.csv"', 'file = "b.csv"\ntemp_degc = 20', "temp_degc of 1 of 2 recordings"),
    ],
)
def test_wrong_tables_of_recordings_are_refused(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    unit = folder_of_two(tmp_path, SEVERAL.replace(old, new))
    assert expected in refusal(unit)


def test_a_temperature_that_is_stated_and_recorded_is_refused(tmp_path: Path) -> None:
    toml = SEVERAL.replace('"b.csv"', '"b.csv"\ntemp_degc = 20').replace(
        "time_column", 'temp_column = "temp_degc"\ntime_column'
    )
    assert "temp_degc and temp_column are both given" in refusal(folder_of_two(tmp_path, toml))


def test_one_recording_with_a_temperature_and_one_without() -> None:
    one, two = both()[1]
    bare = replace(two.all(), temp_degc=None)
    with pytest.raises(RefusedError, match="no temperature, and other recordings have one"):
        joined_recordings([one, replace(two, pieces=lambda: (bare,))])
