"""`triaxcal simulate`: the measurements of a unit that nobody measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.readings.measurements import MEASUREMENTS_FILE, write_measurements
from triaxcal.readings.measurements_csv import DEVIATIONS, READINGS
from triaxcal.simulation.dwells import simulate_codes
from triaxcal.simulation.imu_unit import IMU_TRUTH_FILE, write_simulated_recording
from triaxcal.simulation.published import TABLES_FILE, write_published_measurements
from triaxcal.simulation.truth import TRUTH_FILE, check_seed, read_truth
from triaxcal.unit.description import read_unit
from triaxcal.unit.folder import find_unit


def write_simulated_unit(folder: Path, seed: int | None = None) -> Path:
    """Write measurements.csv of a unit folder that has a truth.toml or a tables.toml.

    A folder with an imu_truth.toml receives the recording of an IMU instead.

    With truth.toml the readings are simulated; `seed` replaces the one in the file. With
    tables.toml they are computed from published constants, without noise. Returns the path
    written; the same input gives the same bytes.

    Raises
    ------
    RefusedError
        When a file is missing or wrong, both are there, or a seed is given with tables.toml.
    """
    find_unit(folder)
    if (folder / IMU_TRUTH_FILE).exists():
        return write_simulated_recording(folder, seed)
    unit = read_unit(folder)
    has_truth, has_tables = (folder / TRUTH_FILE).exists(), (folder / TABLES_FILE).exists()
    if has_truth == has_tables:
        found = (
            "both truth.toml and tables.toml" if has_truth else "no truth.toml and no tables.toml"
        )
        raise RefusedError(
            str(folder),
            found,
            expected="one of the two, as docs/reference/keys.md describes",
            remedy="only simulated units have one; real measurements cannot be simulated again",
        )
    if has_tables:
        if seed is not None:
            raise RefusedError(
                f"{folder / TABLES_FILE}", "has no random values", remedy="omit the seed"
            )
        return write_published_measurements(folder, unit)
    truth, plan = read_truth(folder)
    if seed is not None:
        check_seed(seed, "seed")
        plan = replace(plan, seed=seed)
    target = folder / MEASUREMENTS_FILE
    write_measurements(
        target,
        ("position", "temp_code", *READINGS["code"], "count", *DEVIATIONS["code"]),
        [
            (d.position, d.temp_code, *d.mean_code, d.count, *d.sd_code)
            for d in simulate_codes(unit, truth, plan)
        ],
        (f"Simulated from {TRUTH_FILE}, seed {plan.seed}; nothing here was measured.",),
    )
    return target
