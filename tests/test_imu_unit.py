"""`triaxcal simulate` of an IMU, and that the filter's reader takes what it writes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.reading import read_recording
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import three_axes
from triaxcal.simulation.imu_temperature import SWEPT
from triaxcal.simulation.unit import write_simulated_unit

REPO = Path(__file__).parent.parent
SIM = REPO / "units" / "IMU-SIM"


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    """IMU-SIM with a recording of a minute an axis."""
    folder = tmp_path / "IMU-SIM"
    shutil.copytree(SIM, folder, ignore=shutil.ignore_patterns("recording.csv"))
    change(folder, "imu_truth.toml", "minutes_per_axis = 4", "minutes_per_axis = 1.5")
    return folder


def change(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def refusal(folder: Path, seed: int | None = None) -> str:
    with pytest.raises(RefusedError) as refused:
        write_simulated_unit(folder, seed)
    assert not (folder / "recording.csv").exists()
    return str(refused.value).replace(str(folder), "IMU-SIM")


def test_the_reader_gets_the_simulated_samples_back(unit: Path) -> None:
    assert write_simulated_unit(unit) == unit / "recording.csv"
    read = read_recording(read_dynamic(unit))
    truth = draw_truth(MEMS, 20240229, ("delay", "g-drift"))
    made = simulate_imu(truth, three_axes(1.5, still_s=30.0, temperature=SWEPT), 50.0, 20240229)
    assert (read.latitude_deg, read.gravity_m_per_s2) == (50.0, 9.8107)
    assert read.rate_convention == made.rate_convention
    assert read.force_convention == made.force_convention
    back, there = read.all(), made.all()
    # Ten digits of 60 deg/s, 9.8 m/s^2, 200 s, 85 degC.
    for name, size in (("time_s", 1e3), ("rate", 1.1), ("force", 10.0), ("temp_degc", 100.0)):
        error = np.abs(getattr(back, name) - getattr(there, name))
        assert error.max() <= 0.5e-9 * size, name


def test_the_seed_decides_every_byte(unit: Path) -> None:
    first = write_simulated_unit(unit).read_bytes()
    assert write_simulated_unit(unit, 20240229).read_bytes() == first
    assert write_simulated_unit(unit, 1).read_bytes() != first


def test_every_column_can_be_recorded(unit: Path) -> None:
    change(unit, "imu_truth.toml", '"mems"', '"aviation"')
    change(unit, "imu_truth.toml", '["delay", "g-drift"]', '["second-triad"]')
    change(unit, "imu_truth.toml", '"rough"', '"precise"')
    change(unit, "imu_truth.toml", "rate_hz = 50", "rate_hz = 5")
    header, first, *_ = write_simulated_unit(unit).read_text(encoding="utf-8").splitlines()
    assert header == (
        "time_s,gyro_x_arcsec,gyro_y_arcsec,gyro_z_arcsec,accel_x_mm_per_s,accel_y_mm_per_s,"
        "accel_z_mm_per_s,accel2_x_mm_per_s,accel2_y_mm_per_s,accel2_z_mm_per_s,temp_degc,table_deg"
    )
    assert first.startswith("0.2,")
    assert len(first.split(",")) == 12


def test_a_wrong_effect_is_refused(unit: Path) -> None:
    change(unit, "imu_truth.toml", '"g-drift"', '"drift"')
    assert refusal(unit) == (
        "IMU-SIM/imu_truth.toml, [unit] effects: found 'drift' "
        '(did you mean "g-drift"?); expected a list of '
        "names out of g-drift, delay, accel-positions, mount-elasticity, gyro-elasticity, "
        "second-triad, accel-temperature, gyro-temperature, cubic-temperature"
    )


def test_a_missing_place_is_refused(unit: Path) -> None:
    change(unit, "unit.toml", "latitude_deg = 50\n", "")
    assert refusal(unit) == (
        "IMU-SIM/unit.toml, [site]: missing latitude_deg; expected the place where the unit is "
        "simulated"
    )


def test_a_seed_that_is_none_is_refused(unit: Path) -> None:
    assert refusal(unit, -1) == "seed: found -1; expected a whole number, 0 to 2^63 - 1"


def test_too_short_a_recording_is_refused(unit: Path) -> None:
    change(unit, "imu_truth.toml", "minutes_per_axis = 1.5", "minutes_per_axis = 0.6")
    assert refusal(unit) == (
        "motion of a simulated IMU: 0.6 min an axis, 30 s of it at rest; expected time for at "
        "least three moves"
    )


def test_the_example_of_the_docs_is_read(tmp_path: Path) -> None:
    """The examples of docs/how-to/imu.md, joined: the one with the top of the file comes first."""
    blocks = (REPO / "docs/how-to/imu.md").read_text(encoding="utf-8").split("```toml\n")[1:]
    blocks.sort(key=lambda block: not block.startswith("format = 1"))
    (tmp_path / "IMU-001").mkdir()
    text = "".join(block.split("```")[0] for block in blocks)
    (tmp_path / "IMU-001" / "unit.toml").write_text(text, encoding="utf-8")
    unit = read_dynamic(tmp_path / "IMU-001")
    assert (unit.serial, unit.blocks) == ("IMU-001", ("delay", "g-drift"))
    assert unit.table is not None
    assert unit.device is not None
