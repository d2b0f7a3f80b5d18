"""Temperatures of an IMU's recording: the working range, and thermometers that do not work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dynamic_cases import UNIT_TOML, mems_short, table_of, write_unit
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.unit import calibrate_unit

TEMP = 7
DEVICE = """\
[device]
accel_bits = 21
accel_full_scale_g = 10.48576
gyro_bits = 20
gyro_full_scale_deg_per_s = 500
degc_per_code = 0.0078125
range_degc = [-40, 85]
"""
WITH_COLUMN = UNIT_TOML.replace("[noise]", 'temp_column = "temp_degc"\n[noise]')


def refusal(folder: Path) -> str:
    with pytest.raises(RefusedError) as refused:
        calibrate_unit(folder)
    return str(refused.value).replace(str(folder), "IMU")


def test_a_working_range_beyond_the_recording_is_refused(tmp_path: Path) -> None:
    table = table_of(mems_short()[1])
    table[:, TEMP] = np.linspace(19.9, 28.1, len(table))
    unit = write_unit(tmp_path / "IMU", table, WITH_COLUMN + DEVICE)
    # Medians over 5 s: the ends are 0.2 degC inside, and 0.5 degC more are allowed.
    assert refusal(unit) == (
        "IMU/unit.toml, [device] range_degc: -40 to 85 degC, and the temperatures recorded are "
        "20.0 to 28.1 degC; expected at most 0.5 degC beyond what was recorded: nothing is "
        "extrapolated; record over the whole range, or state [19.6, 28.5]"
    )


def test_the_range_that_the_refusal_names_is_taken(tmp_path: Path) -> None:
    table = table_of(mems_short()[1])
    table[:, TEMP] = np.linspace(19.9, 28.1, len(table))
    toml = WITH_COLUMN + DEVICE.replace("[-40, 85]", "[19.6, 28.5]")
    done = calibrate_unit(write_unit(tmp_path / "IMU", table, toml))
    assert done.range_degc == (19.6, 28.5)
    assert not any("temperature" in finding for finding in done.findings)


def test_without_a_thermometer_the_range_is_reported_as_not_shown(tmp_path: Path) -> None:
    unit = write_unit(tmp_path / "IMU", table_of(mems_short()[1]), UNIT_TOML + DEVICE)
    done = calibrate_unit(unit)
    assert done.recorded_degc is None
    (finding,) = (f for f in done.findings if "temperature" in f)
    assert finding == (
        "no temperature was recorded: it is not shown that the constants hold over the -40 to 85 "
        "degC of [device]"
    )


def test_a_stuck_thermometer_is_refused(tmp_path: Path) -> None:
    table = table_of(mems_short()[1])
    stuck = slice(1000, 4500)
    table[stuck, TEMP] = table[1000, TEMP]
    unit = write_unit(tmp_path / "IMU", table, WITH_COLUMN)
    text = refusal(unit)
    assert text.startswith("IMU/recording.csv, 20.0 s: the temperature reads the same for 70 s, ")
    assert text.endswith(
        "the thermometer is stuck; expected a thermometer that follows the unit; record again, or "
        "cut the recording there"
    )


def test_a_coarse_thermometer_is_no_stuck_one(tmp_path: Path) -> None:
    """Codes of 0.5 degC: minutes of equal readings, and every change is one code."""
    table = table_of(mems_short()[1])
    table[:, TEMP] = np.round(2 * np.linspace(20.0, 20.4, len(table))) / 2
    done = calibrate_unit(write_unit(tmp_path / "IMU", table, WITH_COLUMN))
    assert done.recorded_degc == (20.0, 20.5)


def test_an_implausible_temperature_is_refused(tmp_path: Path) -> None:
    table = table_of(mems_short()[1])
    table[:, TEMP] += 900.0
    assert "temperatures of 919.99 to 920.01" in refusal(
        write_unit(tmp_path / "IMU", table, WITH_COLUMN)
    )
