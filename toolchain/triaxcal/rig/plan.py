"""The plan of a session, a TOML file: what to measure, and every threshold."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, read_tables
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.rig.dbc import LAYOUTS
from triaxcal.unit.description import PLAUSIBLE_DEGC, UnitDescription

FORMAT = 1


@dataclass(frozen=True)
class Stillness:
    """When the unit rests; docs/bench.md explains each.

    Attributes
    ----------
    reference_s : int
        Seconds at rest from which the noise is learned.
    moving_sigma : float
        A block moves when its variance is this many standard deviations above the reference.
    moving_step_micro_g : float
        A block moves when its mean is this far from the one before.
    clean_blocks, settle_s, average_s, guard_s : int
        Seconds at rest before settling; of settling; of averaging; watched behind the averaging
        for slips at its end.
    noise_sigma, slope_t, slip_t, creep_t : float
        Limits of the dwell's variance, slope and largest step, and of the rest's creep, in
        standard deviations.
    batches : int
        Batch means from which u(A) is made; divides average_s.
    u_max_micro_g, allan_floor_micro_g : float
        Largest u(A) accepted; floor of the sensor's Allan deviation, added in quadrature.
    lost_max_ratio, gap_max_s : float
        Most samples lost in a dwell; longest gap.
    jumps_max_ratio : float
        More jumps of the counters than this: another node sends under the rig's IDs.
    """

    reference_s: int = 120
    moving_sigma: float = 5.6
    moving_step_micro_g: float = 1000.0
    clean_blocks: int = 5
    settle_s: int = 20
    average_s: int = 60
    guard_s: int = 12
    noise_sigma: float = 3.5
    slope_t: float = 3.9
    slip_t: float = 4.4
    creep_t: float = 3.7
    batches: int = 20
    u_max_micro_g: float = 3.0
    allan_floor_micro_g: float = 0.5
    lost_max_ratio: float = 0.01
    gap_max_s: float = 0.5
    jumps_max_ratio: float = 0.1


@dataclass(frozen=True)
class Thermal:
    """When the temperature rests.

    Attributes
    ----------
    tolerance_k : float
        Distance from the nominal temperature.
    slope_max_k_per_min : float
        Limit of |dT/dt| + 2u.
    window_s : int
        Over which dT/dt is taken.
    cycle_s : int
        Period of a chamber that cycles, 0 when it does not; the window then spans two at least.
    span_max_k : float
        Largest span of the temperatures of the positions of one step.
    """

    tolerance_k: float = 1.0
    slope_max_k_per_min: float = 0.02
    window_s: int = 300
    cycle_s: int = 0
    span_max_k: float = 0.25


@dataclass(frozen=True)
class Step:
    """Positions to be measured at one temperature."""

    temp_degc: float
    positions: tuple[str, ...]


@dataclass(frozen=True)
class SessionPlan:
    """A plan, validated.

    Attributes
    ----------
    volts_per_g : tuple of three floats
        Nominal scale with its sign; to recognise positions and to state micro-g.
    take_out_of_order : bool
        A position found out of order is taken without asking.
    sha256 : str
        Of the plan's file.
    """

    source: str
    sha256: str
    rate_hz: int
    layout: str
    volts_per_g: tuple[float, float, float]
    take_out_of_order: bool
    steps: tuple[Step, ...]
    stillness: Stillness
    thermal: Thermal

    def micro_g_per_code(self, unit: UnitDescription) -> FloatArray:
        """Nominal micro-g of one code, signed, shape (3,)."""
        return 1e6 * unit.adc.volts_per_code / np.array(self.volts_per_g)


_RANGES: dict[str, tuple[float, float]] = {
    "reference_s": (60, 3600),
    "moving_sigma": (2.0, 50.0),
    "moving_step_micro_g": (1.0, 1e6),
    "clean_blocks": (1, 600),
    "settle_s": (0, 3600),
    "average_s": (10, 3600),
    "guard_s": (0, 600),
    "noise_sigma": (2.0, 50.0),
    "slope_t": (2.0, 50.0),
    "slip_t": (2.0, 50.0),
    "creep_t": (2.0, 50.0),
    "batches": (5, 600),
    "u_max_micro_g": (0.01, 1e5),
    "allan_floor_micro_g": (0.0, 1e5),
    "lost_max_ratio": (0.0, 0.5),
    "gap_max_s": (0.0, 10.0),
    "jumps_max_ratio": (0.0, 1.0),
    "tolerance_k": (0.01, 50.0),
    "slope_max_k_per_min": (1e-4, 10.0),
    "window_s": (30, 7200),
    "cycle_s": (0, 3600),
    "span_max_k": (0.001, 10.0),
}
_LAYOUT: Layout = {
    "": {"format": True, "description": False},
    "rig": {"rate_hz": True, "layout": False, "volts_per_g": True},
    "steps": {
        "temperatures_degc": True,
        "check_temperatures_degc": False,
        "direction": False,
        "take_out_of_order": False,
    },
    "stillness": {f.name: False for f in fields(Stillness)},
    "thermal": {f.name: False for f in fields(Thermal)},
}


def read_plan(path: Path, unit: UnitDescription) -> SessionPlan:
    """Plan of a session for a unit.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/bench.md, or asks for a temperature outside the
        unit's range.
    """
    tables = read_tables(path, _LAYOUT, FORMAT)
    rig = tables["rig"]
    scale = [float(v) for v in rig.decimals("volts_per_g", 3)]
    if not all(1e-4 <= abs(v) <= 100.0 for v in scale):
        raise rig.refuse("volts_per_g", "three signed numbers, 0.0001 to 100 V/g in size")
    steps = tables["steps"]
    stillness = replace(Stillness(), **_settings(tables["stillness"], Stillness()))
    if stillness.average_s % stillness.batches:
        raise RefusedError(
            f"{path}, [stillness] batches",
            f"found {stillness.batches}",
            expected=f"a divisor of average_s, which is {stillness.average_s}",
        )
    return SessionPlan(
        source=str(path),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        rate_hz=rig.integer("rate_hz", 10, 10_000),
        layout=rig.choice("layout", LAYOUTS) if "layout" in rig else LAYOUTS[0],
        volts_per_g=(scale[0], scale[1], scale[2]),
        take_out_of_order=_boolean(steps, "take_out_of_order"),
        steps=_steps(steps, unit),
        stillness=stillness,
        thermal=replace(Thermal(), **_settings(tables["thermal"], Thermal())),
    )


def _settings(table: Table, defaults: Stillness | Thermal) -> dict[str, Any]:
    found: dict[str, int | float] = {}
    for field in fields(defaults):
        if field.name in table:
            low, high = _RANGES[field.name]
            if isinstance(getattr(defaults, field.name), int):
                found[field.name] = table.integer(field.name, int(low), int(high))
            else:
                found[field.name] = table.number(field.name, low, high)
    return found


def _boolean(table: Table, key: str) -> bool:
    if key not in table:
        return False
    value = table.values[key]
    if not isinstance(value, bool):
        raise table.refuse(key, "true or false")
    return value


def _steps(table: Table, unit: UnitDescription) -> tuple[Step, ...]:
    at: dict[float, tuple[str, ...]] = {}
    groups = [("temperatures_degc", tuple(TEST_POSITIONS))]
    if "check_temperatures_degc" in table:
        groups.append(("check_temperatures_degc", CHECK_POSITIONS))
    for key, positions in groups:
        for temp in table.rising(key, *PLAUSIBLE_DEGC, range(1, 65)):
            if unit.range_degc and not unit.range_degc[0] <= temp <= unit.range_degc[1]:
                low, high = unit.range_degc
                raise RefusedError(
                    table.where(key),
                    f"found {temp:g} degC",
                    expected=f"temperatures of the unit's range, {low:g} to {high:g} degC",
                    remedy=f"correct the plan, or range_degc in the unit.toml of {unit.name}",
                )
            at[temp] = at.get(temp, ()) + positions
    down = "direction" in table and table.choice("direction", ("up", "down")) == "down"
    return tuple(Step(temp, at[temp]) for temp in sorted(at, reverse=down))
