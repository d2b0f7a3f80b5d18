"""`triaxcal simulate` of an IMU: recording.csv from imu_truth.toml, a grade and a seed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, TableKeys, Values, setting
from triaxcal.base.kinds import Kind, listed, meaning, number, three, word
from triaxcal.base.tomltable import read_toml
from triaxcal.dynamic.recording import INCREMENT, ImuRecording
from triaxcal.readings.measurements import write_measurements
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import EFFECTS, GRADES, Grade, draw_truth
from triaxcal.simulation.imu_motion import (
    PRECISE_TABLE,
    ImuMotion,
    Move,
    RoughTable,
    three_axes,
)
from triaxcal.simulation.imu_temperature import SWEPT, WARMING, TemperatureDrift
from triaxcal.simulation.imu_truth import ARCSEC
from triaxcal.simulation.truth import SEED, check_seed
from triaxcal.unit.folder import find_unit
from triaxcal.unit.site import TurningSite

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


@dataclass(frozen=True)
class _Unit:
    """[unit]: the sensors.

    Attributes
    ----------
    grade
        How good the sensors are.
    seed
        Seed of the constants and the noise.
    effects
        Effects of the unit beyond the base model.
    """

    grade: Grade = setting(meaning(GRADES), example='"mems"')
    seed: int = setting(SEED, example="1")
    effects: tuple[str, ...] = setting(
        listed(word(tuple(EFFECTS)), range(100), f"a list of names out of {', '.join(EFFECTS)}"),
        (),
        words="none",
    )


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """[motion]: how the unit is turned.

    Attributes
    ----------
    rate_hz
        Samples a second.
    minutes_per_axis
        How long the usual moves are repeated, three at least. This or `moves`.
    moves
        Moves of each axis: [angle in deg, rate in deg/s, stop in s], the angle signed.
    still_s
        Stand-still before the first move of each axis.
    table
        rough: 1 deg off level, wobbling, no angles; precise: no wobble, its angle is recorded.
    temperature
        constant: 20 degC; warming: 20 to 45 degC, with waves; swept: -40 to 85 degC and back in
        four minutes, again and again.
    """

    rate_hz: float = setting(number(1.0, 1e4), unit="Hz", example="50")
    minutes_per_axis: float | None = setting(number(0.5, 600.0), None, "min", example="4")
    moves: tuple[Move, ...] | None = setting(
        Kind(
            "a list of [angle in deg, rate in deg/s, stop in s] such as [-360, 30, 5], rates up "
            f"to 1000, stops up to 36000, each angle reaching its rate in {_RAMP_S:g} s",
            _moves,
            {"type": "array", "items": _THREE_NUMBERS.schema, "minItems": 1},
            example="[[360, 30, 5], [-360, 30, 5]]",
        ),
        None,
    )
    still_s: float = setting(number(1.0, 36000.0), unit="s", example="30")
    table: RoughTable = setting(meaning({"rough": RoughTable(), "precise": PRECISE_TABLE}))
    temperature: TemperatureDrift | None = setting(
        meaning({"constant": None, "warming": WARMING, "swept": SWEPT})
    )


IMU_TRUTH = FileKeys(
    IMU_TRUTH_FILE,
    "What a simulated IMU is, and how it is moved",
    (
        TableKeys("", "", (FORMAT,)),
        TableKeys.of(_Unit),
        TableKeys.of(_Motion),
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
        When a file is missing or breaks a rule of docs/reference/keys.md.
    """
    tables = IMU_TRUTH.read(folder / IMU_TRUTH_FILE)
    unit, motion = tables["unit"].record(_Unit), tables["motion"].record(_Motion)
    if seed is None:
        seed = unit.seed
    check_seed(seed, "seed")
    truth = draw_truth(unit.grade, seed, unit.effects)
    recording = simulate_imu(truth, _plan(folder, tables["motion"]), motion.rate_hz, seed)
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
    return _plan(folder, motion), motion.record(_Motion).rate_hz


def _plan(folder: Path, values: Values) -> ImuMotion:
    site = _site(find_unit(folder))
    motion = values.record(_Motion)
    if (motion.moves is None) == (motion.minutes_per_axis is None):
        raise RefusedError(
            f"{values.where('moves')} and minutes_per_axis",
            "neither given" if motion.moves is None else "both given",
            expected="one of them: the moves of an axis, or how long the usual ones are repeated",
        )
    plan = three_axes(
        motion.minutes_per_axis or 0.0,
        still_s=motion.still_s,
        table=motion.table,
        temperature=motion.temperature,
        moves=motion.moves,
    )
    return replace(
        plan, latitude_deg=site.latitude_deg, gravity_m_per_s2=site.local_gravity_m_per_s2
    )


def _site(path: Path) -> TurningSite:
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
    return Values(str(path), "site", values).record(TurningSite)


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
