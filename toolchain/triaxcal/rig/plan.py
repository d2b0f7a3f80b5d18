"""The plan of a session, a TOML file: what to measure, and every threshold."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, Key, TableKeys, Values, key, keys_of
from triaxcal.base.kinds import FLAG, number, rising, three, whole, word
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import DESCRIPTION, UnitDescription


def _threshold(low: float, doc: str, default: float, unit: str = "sigma") -> float:
    """A limit in standard deviations."""
    return key(number(low, 50.0), doc, default, unit)


@dataclass(frozen=True)
class Stillness:
    """[stillness]: when the unit rests; docs/how-to/bench.md explains each."""

    reference_s: int = key(
        whole(60, 3600), "Time at rest from which the noise is learned.", 120, "s"
    )
    moving_sigma: float = _threshold(
        2.0, "A block moves when its variance is this far above the reference.", 5.6
    )
    moving_step_micro_g: float = key(
        number(1.0, 1e6),
        "A block moves when its mean is this far from the one before.",
        1000.0,
        "micro-g",
    )
    clean_blocks: int = key(whole(1, 600), "Seconds at rest before settling.", 5, "s")
    settle_s: int = key(whole(0, 3600), "Time of settling.", 20, "s")
    average_s: int = key(whole(10, 3600), "Time of averaging.", 60, "s")
    guard_s: int = key(
        whole(0, 600), "Time watched after the averaging, for slips at its end.", 12, "s"
    )
    noise_sigma: float = _threshold(2.0, "Limit of the dwell's variance.", 3.5)
    slope_t: float = _threshold(2.0, "Limit of the dwell's slope.", 3.9)
    slip_t: float = _threshold(2.0, "Limit of the dwell's largest step.", 4.4)
    creep_t: float = _threshold(2.0, "Limit of the creep at rest.", 3.7)
    batches: int = key(whole(5, 600), "Batch means from which u(A) is made; divides average_s.", 20)
    u_max_micro_g: float = key(number(0.01, 1e5), "Largest u(A) accepted.", 3.0, "micro-g")
    allan_floor_micro_g: float = key(
        number(0.0, 1e5),
        "Floor of the sensor's Allan deviation, added in quadrature.",
        0.5,
        "micro-g",
    )
    lost_max_ratio: float = key(number(0.0, 0.5), "Most samples lost in a dwell.", 0.01)
    gap_max_s: float = key(number(0.0, 10.0), "Longest gap.", 0.5, "s")
    jumps_max_ratio: float = key(
        number(0.0, 1.0),
        "With more jumps of the counters, another node sends under the rig's IDs.",
        0.1,
    )


@dataclass(frozen=True)
class Thermal:
    """[thermal]: when the temperature rests."""

    tolerance_k: float = key(number(0.01, 50.0), "Distance from the nominal temperature.", 1.0, "K")
    slope_max_k_per_min: float = key(number(1e-4, 10.0), "Limit of |dT/dt| + 2u.", 0.02, "K/min")
    window_s: int = key(whole(30, 7200), "Time over which dT/dt is taken.", 300, "s")
    cycle_s: int = key(
        whole(0, 3600),
        "Period of a chamber that cycles, 0 when it does not; the window then spans two at least.",
        0,
        "s",
    )
    span_max_k: float = key(
        number(0.001, 10.0),
        "Largest span of the temperatures of the positions of one step.",
        0.25,
        "K",
    )


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


RATE = Key(
    "rate_hz", whole(10, 10_000), "Readings a second of each axis.", unit="Hz", example="100"
)
LAYOUT = Key("layout", word(("classic", "fd")), "Layout of the frames on the bus.", "classic")
VOLTS_PER_G = Key(
    "volts_per_g",
    three(
        number(-100.0, 100.0),
        "three signed numbers, 0.0001 to 100 V/g in size",
        lambda v: abs(v) >= 1e-4,
    ),
    "Nominal scale of x, y, z with its sign.",
    unit="V/g",
    example="[0.5, 0.5, 0.5]",
)
_TEMPERATURES = rising(*PLAUSIBLE_DEGC, 1, 64)
TEMPERATURES = Key(
    "temperatures_degc",
    _TEMPERATURES,
    "Temperatures at which TP1 to TP6 are measured.",
    unit="degC",
    example="[-20, 20, 60]",
)
CHECK_TEMPERATURES = Key(
    "check_temperatures_degc",
    _TEMPERATURES,
    "Temperatures at which CP1 to CP6 are measured.",
    None,
    "degC",
)
DIRECTION = Key("direction", word(("up", "down")), "Order of the temperatures.", "up")
OUT_OF_ORDER = Key(
    "take_out_of_order", FLAG, "A position found out of order is taken without asking.", False
)
SESSION_PLAN = FileKeys(
    "plan.toml",
    "The plan of a session at the rig",
    (
        TableKeys("", "", (FORMAT, DESCRIPTION)),
        TableKeys("rig", "What the unit sends.", (RATE, LAYOUT, VOLTS_PER_G)),
        TableKeys(
            "steps",
            "What is measured.",
            (TEMPERATURES, CHECK_TEMPERATURES, DIRECTION, OUT_OF_ORDER),
        ),
        TableKeys("stillness", "When the unit rests.", keys_of(Stillness)),
        TableKeys("thermal", "When the temperature rests.", keys_of(Thermal)),
    ),
)


def read_plan(path: Path, unit: UnitDescription) -> SessionPlan:
    """Plan of a session for a unit.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/bench.md, or asks for a temperature outside the
        unit's range.
    """
    tables = SESSION_PLAN.read(path)
    rig, steps = tables["rig"], tables["steps"]
    stillness = tables["stillness"].record(Stillness)
    if stillness.average_s % stillness.batches:
        raise RefusedError(
            f"{path}, [stillness] batches",
            f"found {stillness.batches}",
            expected=f"a divisor of average_s, which is {stillness.average_s}",
        )
    return SessionPlan(
        source=str(path),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        rate_hz=rig[RATE],
        layout=rig[LAYOUT],
        volts_per_g=rig[VOLTS_PER_G],
        take_out_of_order=steps[OUT_OF_ORDER],
        steps=_steps(steps, unit),
        stillness=stillness,
        thermal=tables["thermal"].record(Thermal),
    )


def _steps(values: Values, unit: UnitDescription) -> tuple[Step, ...]:
    at: dict[float, tuple[str, ...]] = {}
    for temps, positions in (
        (TEMPERATURES, tuple(TEST_POSITIONS)),
        (CHECK_TEMPERATURES, CHECK_POSITIONS),
    ):
        for temp in values[temps] or ():
            if unit.range_degc and not unit.range_degc[0] <= temp <= unit.range_degc[1]:
                low, high = unit.range_degc
                raise RefusedError(
                    values.where(temps),
                    f"found {temp:g} degC",
                    expected=f"temperatures of the unit's range, {low:g} to {high:g} degC",
                    remedy=f"correct the plan, or range_degc in the unit.toml of {unit.name}",
                )
            at[temp] = at.get(temp, ()) + positions
    return tuple(Step(temp, at[temp]) for temp in sorted(at, reverse=values[DIRECTION] == "down"))
