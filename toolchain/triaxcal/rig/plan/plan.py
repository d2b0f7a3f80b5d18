"""The plan of a session, a TOML file: what to measure, and every threshold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import DESCRIPTION, FORMAT, FileKeys, TableKeys, Values, setting
from triaxcal.base.kinds import line, number, three, whole, word
from triaxcal.base.tomltable import read_toml
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.hands.equipment import (
    Equipment,
    equipment_tables,
    read_equipment,
    refuse_without_angles,
)
from triaxcal.rig.plan.plansteps import Step, StepKeys, planned_steps, refuse_merged
from triaxcal.rig.plan.planunits import UnitKeys, planned_units
from triaxcal.unit.description import UnitDescription

LAYOUTS: Mapping[str, str] = MappingProxyType({"classic": "tilter", "fd": "tilter-fd"})
"""Rig descriptions of plans that name a layout of the tilter's frames."""


@dataclass(frozen=True)
class Stillness:
    """[stillness]: when the unit rests.

    Attributes
    ----------
    reference_s
        Time at rest from which the noise is learned.
    moving_sigma
        A block moves when its variance is this far above the reference.
    moving_step_micro_g
        A block moves when its mean is this far from the one before.
    clean_blocks
        Seconds at rest before settling.
    settle_s
        Time of settling.
    average_s
        Time of averaging.
    guard_s
        Time watched after the averaging, for slips at its end.
    noise_sigma
        Limit of the dwell's variance.
    slope_t
        Limit of the dwell's slope.
    slip_t
        Limit of the dwell's largest step.
    creep_t
        Limit of the creep at rest.
    batches
        Batch means from which u(A) is made; divides average_s.
    u_max_micro_g
        Largest u(A) accepted.
    allan_floor_micro_g
        Floor of the sensor's Allan deviation, added in quadrature.
    lost_max_ratio
        Most samples lost in a dwell.
    gap_max_s
        Longest gap.
    jumps_max_ratio
        With more jumps of the counters, another node sends under the rig's IDs.
    """

    reference_s: int = setting(whole(60, 3600), 120, "s")
    moving_sigma: float = setting(number(2.0, 50.0), 5.6, "sigma")
    moving_step_micro_g: float = setting(number(1.0, 1e6), 1000.0, "micro-g")
    clean_blocks: int = setting(whole(1, 600), 5, "s")
    settle_s: int = setting(whole(0, 3600), 20, "s")
    average_s: int = setting(whole(10, 3600), 60, "s")
    guard_s: int = setting(whole(0, 600), 12, "s")
    noise_sigma: float = setting(number(2.0, 50.0), 3.5, "sigma")
    slope_t: float = setting(number(2.0, 50.0), 3.9, "sigma")
    slip_t: float = setting(number(2.0, 50.0), 4.4, "sigma")
    creep_t: float = setting(number(2.0, 50.0), 3.7, "sigma")
    batches: int = setting(whole(5, 600), 20)
    u_max_micro_g: float = setting(number(0.01, 1e5), 3.0, "micro-g")
    allan_floor_micro_g: float = setting(number(0.0, 1e5), 0.5, "micro-g")
    lost_max_ratio: float = setting(number(0.0, 0.5), 0.01)
    gap_max_s: float = setting(number(0.0, 10.0), 0.5, "s")
    jumps_max_ratio: float = setting(number(0.0, 1.0), 0.1)


@dataclass(frozen=True)
class Thermal:
    """[thermal]: when the temperature rests.

    Attributes
    ----------
    tolerance_k
        Distance from the nominal temperature.
    slope_max_k_per_min
        Limit of |dT/dt| + 2u.
    window_s
        Time over which dT/dt is taken.
    cycle_s
        Period of a chamber that cycles, 0 when it does not; the window then spans two at least.
    span_max_k
        Largest span of the temperatures of the positions of one step.
    """

    tolerance_k: float = setting(number(0.01, 50.0), 1.0, "K")
    slope_max_k_per_min: float = setting(number(1e-4, 10.0), 0.02, "K/min")
    window_s: int = setting(whole(30, 7200), 300, "s")
    cycle_s: int = setting(whole(0, 3600), 0, "s")
    span_max_k: float = setting(number(0.001, 10.0), 0.25, "K")


@dataclass(frozen=True)
class SessionPlan:
    """A plan, validated.

    Attributes
    ----------
    rig : Path
        The rig description, rig.toml.
    volts_per_g : tuple of three floats, or None
        Nominal scale with its sign; to recognise positions and to state micro-g. None is that of
        unit.toml or of the bus description.
    take_out_of_order : bool
        A position found out of order is taken without asking.
    units : mapping
        Units that are measured together, by name; empty in the plan of one unit.
    sha256 : str
        Of the plan's file; of what decides in it, where it has tables of the equipment: an address
        may be corrected between `rig run` and `rig resume`.
    """

    source: str
    sha256: str
    rate_hz: int
    rig: Path
    volts_per_g: tuple[float, float, float] | None
    take_out_of_order: bool
    steps: tuple[Step, ...]
    stillness: Stillness
    thermal: Thermal
    equipment: Equipment
    units: Mapping[str, UnitKeys] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Rig:
    """[rig]: what the unit sends.

    Attributes
    ----------
    rate_hz
        Readings a second of each axis.
    rig
        What the unit sends: the name of a description that came with triaxcal, or the path of a
        rig.toml.
    layout
        In place of rig, the frames of the tilter: "classic" is rig = "tilter", "fd" is "tilter-fd".
    volts_per_g
        Nominal scale of x, y, z with its sign; required where neither unit.toml ([sensor]) nor the
        bus description states it.
    """

    rate_hz: int = setting(whole(10, 10_000), unit="Hz", example="100")
    rig: str | None = setting(line(), None, words='"tilter"', example='"tilter"')
    layout: str | None = setting(word(tuple(LAYOUTS)), None, words="by rig", example='"classic"')
    volts_per_g: tuple[float, float, float] | None = setting(
        three(
            number(-100.0, 100.0),
            "three signed numbers, 0.0001 to 100 V/g in size",
            lambda v: abs(v) >= 1e-4,
        ),
        None,
        "V/g",
        words="that of unit.toml or of the bus description",
        example="[0.5, 0.5, 0.5]",
    )


def session_plan_file() -> FileKeys:
    """Keys of a plan; those of registered drivers are among them."""
    return FileKeys(
        "plan.toml",
        "The plan of a session at the rig",
        (
            TableKeys("", "", (FORMAT, DESCRIPTION)),
            TableKeys.of(_Rig),
            TableKeys.of(StepKeys),
            TableKeys.of(Stillness),
            TableKeys.of(Thermal),
            *equipment_tables(),
            TableKeys.of(UnitKeys),
        ),
        first=("volts_per_g",),
    )


def read_plan(path: Path, unit: UnitDescription) -> SessionPlan:
    """Plan of a session for a unit.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/reference/keys.md, or asks for a temperature outside the
        unit's range.
    """
    tables = session_plan_file().read(path)
    rig, steps = tables["rig"].record(_Rig), tables["steps"].record(StepKeys)
    stillness = tables["stillness"].record(Stillness)
    if stillness.average_s % stillness.batches:
        raise RefusedError(
            f"{path}, [stillness] batches",
            f"found {stillness.batches}",
            expected=f"a divisor of average_s, which is {stillness.average_s}",
        )
    equipment = read_equipment(tables)
    thermal = tables["thermal"].record(Thermal)
    refuse_merged(tables["steps"], steps.temperatures_degc, thermal.tolerance_k)
    planned = planned_steps(tables["steps"], steps, unit, equipment)
    every = (position for step in planned for position in step.positions)
    refuse_without_angles(equipment, tables["positioner"], every)
    units = planned_units(str(path), tables)
    return SessionPlan(
        source=str(path),
        sha256=_hash_of(path),
        rate_hz=rig.rate_hz,
        rig=_rig_file(tables["rig"], rig, path.parent),
        volts_per_g=rig.volts_per_g,
        # The order of many units is that of the tilter, and each takes what it can.
        take_out_of_order=steps.take_out_of_order or bool(units),
        steps=planned,
        stillness=stillness,
        thermal=thermal,
        equipment=equipment,
        units=units,
    )


def list_planned(path: Path) -> Mapping[str, UnitKeys]:
    """Units that a plan lists, by name; none in the plan of one unit.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/reference/keys.md.
    """
    return planned_units(str(path), session_plan_file().read(path))


def _rig_file(values: Values, keys: _Rig, folder: Path) -> Path:
    """The rig.toml that a plan names."""
    if keys.rig is None:
        return find_description(LAYOUTS[keys.layout or "classic"])
    if keys.layout is not None:
        raise values.refuse("layout", "rig alone: it says what the frames are", "leave layout out")
    return find_description(keys.rig, folder)


def _hash_of(path: Path) -> str:
    """SHA-256 of a plan's file, or of the tables that decide where it has others."""
    document = read_toml(path)
    equipment = {table.name for table in equipment_tables()} & set(document)
    if not equipment:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    decides = {name: table for name, table in document.items() if name not in equipment}
    return hashlib.sha256(json.dumps(decides, sort_keys=True, default=str).encode()).hexdigest()
