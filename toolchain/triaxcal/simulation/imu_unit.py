"""`triaxcal simulate` of an IMU: recording.csv from imu_truth.toml, a grade and a seed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, read_tables, read_toml
from triaxcal.dynamic.recording import INCREMENT, ImuRecording
from triaxcal.readings.measurements import write_measurements
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import EFFECTS, GRADES, draw_truth
from triaxcal.simulation.imu_motion import (
    PRECISE_TABLE,
    WARMING,
    ImuMotion,
    Move,
    RoughTable,
    three_axes,
)
from triaxcal.simulation.imu_truth import ARCSEC
from triaxcal.simulation.truth import SEED_MAX, check_seed
from triaxcal.unit.description import find_unit

FORMAT = 1
IMU_TRUTH_FILE = "imu_truth.toml"
RECORDING_FILE = "recording.csv"
_LAYOUT: Layout = {
    "": {"format": True},
    "unit": {"grade": True, "seed": True, "effects": False},
    "motion": {
        "rate_hz": True,
        "minutes_per_axis": False,
        "moves": False,
        "still_s": True,
        "table": True,
        "temperature": True,
    },
}


def write_simulated_recording(folder: Path, seed: int | None = None) -> Path:
    """Write recording.csv of a unit folder that has an imu_truth.toml; returns its path.

    `seed` replaces the one in the file; the same input gives the same bytes. Place and gravity
    are those of [site] in unit.toml.

    Raises
    ------
    RefusedError
        When a file is missing or breaks a rule of docs/file-formats.md.
    """
    tables = read_tables(folder / IMU_TRUTH_FILE, _LAYOUT, FORMAT)
    unit, motion = tables["unit"], tables["motion"]
    if seed is None:
        seed = unit.integer("seed", 0, SEED_MAX)
    check_seed(seed, "seed")
    grade = GRADES[unit.choice("grade", tuple(GRADES))]
    truth = draw_truth(grade, seed, _effects(unit))
    plan = _plan(folder, motion)
    recording = simulate_imu(truth, plan, motion.number("rate_hz", 1.0, 1e4), seed)
    target = folder / RECORDING_FILE
    write_measurements(target, _columns(recording), _rows(recording))
    return target


def planned_motion(folder: Path) -> tuple[ImuMotion, float]:
    """Motion that imu_truth.toml of a unit folder plans, and its sampling rate, Hz.

    Raises
    ------
    RefusedError
        As `write_simulated_recording`.
    """
    motion = read_tables(folder / IMU_TRUTH_FILE, _LAYOUT, FORMAT)["motion"]
    return _plan(folder, motion), motion.number("rate_hz", 1.0, 1e4)


def _plan(folder: Path, motion: Table) -> ImuMotion:
    site = _site(find_unit(folder))
    precise = motion.choice("table", ("rough", "precise")) == "precise"
    warming = motion.choice("temperature", ("constant", "warming")) == "warming"
    still_s = motion.number("still_s", 1.0, 36000.0)
    if ("moves" in motion) == ("minutes_per_axis" in motion):
        raise RefusedError(
            f"{motion.where('moves')} and minutes_per_axis",
            "both given" if "moves" in motion else "neither given",
            expected="one of them: the moves of an axis, or how long the usual ones are repeated",
        )
    given = None if "moves" not in motion else _moves(motion, RoughTable().ramp_s)
    plan = three_axes(
        motion.number("minutes_per_axis", 0.5, 600.0) if given is None else 0.0,
        still_s=still_s,
        table=PRECISE_TABLE if precise else RoughTable(),
        temperature=WARMING if warming else None,
        moves=given,
    )
    return replace(
        plan,
        latitude_deg=site.number("latitude_deg", -90.0, 90.0),
        gravity_m_per_s2=site.number("local_gravity_m_per_s2", 9.7, 9.9),
    )


def _moves(motion: Table, ramp_s: float) -> tuple[Move, ...]:
    expected = (
        "a list of [angle in deg, rate in deg/s, stop in s] such as [-360, 30, 5], rates up to "
        f"1000, stops up to 36000, each angle reaching its rate in {ramp_s:g} s"
    )
    rows = motion.values["moves"]
    if not isinstance(rows, list) or not rows:
        raise motion.refuse("moves", expected)
    for row in rows:
        sound = (
            isinstance(row, list)
            and len(row) == 3
            and all(type(value) in (int, float) and math.isfinite(value) for value in row)
        )
        if not sound or not (0 < row[1] <= 1000 and 0 <= row[2] <= 36000):
            raise motion.refuse("moves", expected)
        if not row[1] * ramp_s <= abs(row[0]) <= 1e6:
            raise motion.refuse("moves", expected)
    return tuple(Move(float(a), float(rate), float(stop)) for a, rate, stop in rows)


def _effects(unit: Table) -> tuple[str, ...]:
    effects = unit.values.get("effects", [])
    if not isinstance(effects, list) or not all(effect in EFFECTS for effect in effects):
        raise unit.refuse("effects", "a list of names out of " + ", ".join(EFFECTS))
    return tuple(effects)


def _site(path: Path) -> Table:
    """[site] of a unit.toml."""
    site = read_toml(path).get("site")
    values = site if isinstance(site, dict) else {}
    missing = [k for k in ("latitude_deg", "local_gravity_m_per_s2") if k not in values]
    if missing:
        raise RefusedError(
            f"{path}, [site]",
            "missing " + " and ".join(missing),
            expected="the place where the unit is simulated",
        )
    return Table(str(path), "site", values)


def _columns(recording: ImuRecording) -> tuple[str, ...]:
    """Names of the columns with their units."""
    first = next(iter(recording.pieces()))
    rate = "arcsec" if recording.rate_convention == INCREMENT else "deg_per_s"
    force = "mm_per_s" if recording.force_convention == INCREMENT else "m_per_s2"
    names = ["time_s", *(f"gyro_{a}_{rate}" for a in "xyz"), *(f"accel_{a}_{force}" for a in "xyz")]
    if first.force2 is not None:
        names += [f"accel2_{axis}_{force}" for axis in "xyz"]
    names.append("temp_degc")
    if first.table_angle_rad is not None:
        names.append("table_deg")
    return tuple(names)


def _rows(recording: ImuRecording) -> Iterator[tuple[str, ...]]:
    """Rows of text, to ten digits."""
    per_rate = ARCSEC if recording.rate_convention == INCREMENT else math.radians(1.0)
    per_force = 1e-3 if recording.force_convention == INCREMENT else 1.0
    for piece in recording.pieces():
        columns = [piece.time_s, *(piece.rate.T / per_rate), *(piece.force.T / per_force)]
        if piece.force2 is not None:
            columns += [*(piece.force2.T / per_force)]
        if piece.temp_degc is not None:
            columns.append(piece.temp_degc)
        if piece.table_angle_rad is not None:
            columns.append(piece.table_angle_rad / math.radians(1.0))
        for row in zip(*(column.tolist() for column in columns), strict=True):
            yield tuple(f"{value:.10g}" for value in row)
