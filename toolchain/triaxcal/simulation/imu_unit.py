"""`triaxcal simulate` of an IMU: recording.csv from imu_truth.toml, a grade and a seed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, Key, TableKeys, Values
from triaxcal.base.kinds import Kind, listed, meaning, number, three, word
from triaxcal.base.tomltable import read_toml
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
from triaxcal.simulation.truth import SEED as SEED_KIND
from triaxcal.simulation.truth import check_seed
from triaxcal.unit.description import GRAVITY, LATITUDE, find_unit

IMU_TRUTH_FILE = "imu_truth.toml"
RECORDING_FILE = "recording.csv"


def _moves(rows: object) -> tuple[Move, ...]:
    if not isinstance(rows, list) or not rows:
        raise ValueError
    moves = tuple(Move(*_THREE_NUMBERS.parse(row)) for row in rows)
    for move in moves:
        if not (0 < move.rate_deg_per_s <= 1000 and 0 <= move.stop_s <= 36000):
            raise ValueError
        if not move.rate_deg_per_s * _RAMP_S <= abs(move.angle_deg) <= 1e6:
            raise ValueError
    return moves


_RAMP_S = RoughTable().ramp_s
_THREE_NUMBERS = three(number(), "")
GRADE = Key("grade", meaning(GRADES), "How good the sensors are.", example='"mems"')
SEED = Key("seed", SEED_KIND, "Seed of the constants and the noise.", example="1")
_EFFECTS = ", ".join(EFFECTS)
IMU_EFFECTS = Key(
    "effects",
    listed(word(tuple(EFFECTS)), range(100), f"a list of names out of {_EFFECTS}"),
    "Effects of the unit beyond the base model.",
    (),
    default_words="none",
)
RATE = Key("rate_hz", number(1.0, 1e4), "Samples a second.", unit="Hz", example="50")
MINUTES = Key(
    "minutes_per_axis",
    number(0.5, 600.0),
    "How long the usual moves are repeated, three at least. This or `moves`.",
    None,
    "min",
    example="4",
)
MOVES = Key(
    "moves",
    Kind(
        "a list of [angle in deg, rate in deg/s, stop in s] such as [-360, 30, 5], rates up to "
        f"1000, stops up to 36000, each angle reaching its rate in {_RAMP_S:g} s",
        _moves,
        {"type": "array", "items": _THREE_NUMBERS.schema, "minItems": 1},
    ),
    "Moves of each axis: [angle in deg, rate in deg/s, stop in s], the angle signed.",
    None,
    example="[[360, 30, 5], [-360, 30, 5]]",
)
STILL = Key(
    "still_s",
    number(1.0, 36000.0),
    "Stand-still before the first move of each axis.",
    unit="s",
    example="30",
)
TABLE = Key(
    "table",
    meaning({"rough": RoughTable(), "precise": PRECISE_TABLE}),
    "rough: 1 deg off level, wobbling, no angles; precise: no wobble, its angle is recorded.",
    example='"rough"',
)
TEMPERATURE = Key(
    "temperature",
    meaning({"constant": None, "warming": WARMING}),
    "constant: 20 degC; warming: 20 to 45 degC, with waves.",
    example='"constant"',
)
IMU_TRUTH = FileKeys(
    IMU_TRUTH_FILE,
    "What a simulated IMU is, and how it is moved",
    (
        TableKeys("", "", (FORMAT,)),
        TableKeys("unit", "The sensors.", (GRADE, SEED, IMU_EFFECTS)),
        TableKeys("motion", "The motion.", (RATE, MINUTES, MOVES, STILL, TABLE, TEMPERATURE)),
    ),
    ("minutes_per_axis",),
)


def write_simulated_recording(folder: Path, seed: int | None = None) -> Path:
    """Write recording.csv of a unit folder that has an imu_truth.toml; returns its path.

    `seed` replaces the one in the file; the same input gives the same bytes. Place and gravity
    are those of [site] in unit.toml.

    Raises
    ------
    RefusedError
        When a file is missing or breaks a rule of docs/file-formats.md.
    """
    tables = IMU_TRUTH.read(folder / IMU_TRUTH_FILE)
    unit, motion = tables["unit"], tables["motion"]
    if seed is None:
        seed = unit[SEED]
    check_seed(seed, "seed")
    truth = draw_truth(unit[GRADE], seed, unit[IMU_EFFECTS])
    recording = simulate_imu(truth, _plan(folder, motion), motion[RATE], seed)
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
    motion = IMU_TRUTH.read(folder / IMU_TRUTH_FILE)["motion"]
    return _plan(folder, motion), motion[RATE]


def _plan(folder: Path, motion: Values) -> ImuMotion:
    site = _site(find_unit(folder))
    moves, minutes = motion[MOVES], motion[MINUTES]
    if (moves is None) == (minutes is None):
        raise RefusedError(
            f"{motion.where(MOVES)} and minutes_per_axis",
            "neither given" if moves is None else "both given",
            expected="one of them: the moves of an axis, or how long the usual ones are repeated",
        )
    plan = three_axes(
        minutes or 0.0,
        still_s=motion[STILL],
        table=motion[TABLE],
        temperature=motion[TEMPERATURE],
        moves=moves,
    )
    return replace(plan, latitude_deg=site[LATITUDE], gravity_m_per_s2=site[GRAVITY])


def _site(path: Path) -> Values:
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
    return Values(str(path), "site", values)


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
