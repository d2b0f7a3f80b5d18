"""Many simulated units in one simulated chamber, on one table, on several virtual buses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.many.setup import ManySetup, Place
from triaxcal.rig.simulated.simorders import Fault, read_fault
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import TRUTH_FILE, read_truth

SHARED = frozenset({"deaf", "kelvin", "runaway", "halt", "astray"})
"""Faults of chamber and table, which all units share."""


class SimulatedBench:
    """Simulated units that are turned and heated together.

    Parameters
    ----------
    rigs : mapping
        Simulated unit by name, in the order of the plan.
    buses : mapping
        Names of the units of each bus.
    """

    def __init__(
        self, rigs: Mapping[str, SimulatedRig], buses: Mapping[str, Sequence[str]]
    ) -> None:
        self.rigs = dict(rigs)
        self.lanes = {bus: Lane([rigs[name] for name in names]) for bus, names in buses.items()}
        self._first = next(iter(self.rigs.values()))

    @property
    def settings(self) -> RigSettings:
        """Settings of the chamber and the table."""
        return self._first.settings

    @property
    def seconds(self) -> int:
        """Seconds simulated so far."""
        return min(rig.seconds for rig in self.rigs.values())

    @property
    def position(self) -> str:
        """Position of the table."""
        return self._first.position

    @property
    def turning(self) -> bool:
        """A turn is under way, or has stopped half way."""
        return self._first.turning

    @property
    def chamber_degc(self) -> float:
        """True temperature of the chamber."""
        return self._first.chamber_degc

    @property
    def target_degc(self) -> float:
        """Set point of the chamber."""
        return self._first.target_degc

    @target_degc.setter
    def target_degc(self, degc: float) -> None:
        for rig in self.rigs.values():
            rig.target_degc = degc

    def active(self, kind: str) -> Fault | None:
        """Fault of chamber or table that is in force now."""
        return self._first.active(kind)

    def turn_to(self, position: str) -> None:
        """Start a turn, unless it is there or on its way."""
        for rig in self.rigs.values():
            rig.turn_to(position)


class Lane:
    """The units of one bus."""

    def __init__(self, rigs: Sequence[SimulatedRig]) -> None:
        self._rigs = tuple(rigs)

    def advance(self) -> Frames:
        """Frames of the next second, in the order of their times."""
        frames = concatenate([rig.advance() for rig in self._rigs])
        return frames.take(np.argsort(frames.t_ns, kind="stable"))


def simulated_bench(
    setup: ManySetup,
    orders: Sequence[str] = (),
    seed: int = 1,
    settings: RigSettings | None = None,
) -> SimulatedBench:
    """Bench of the units of a plan, each from its truth.toml.

    Parameters
    ----------
    orders : sequence of str
        Faults: "UNIT/kind@seconds..." of one unit; without "UNIT/" of all.

    Raises
    ------
    UsageError
        When a fault names no unit, or a fault of chamber or table names one.
    RefusedError
        When a unit has no truth.toml.
    """
    names = [place.name for place in setup.places]
    faults = [_fault(order, names) for order in orders]
    rigs = {}
    for number, place in enumerate(setup.places):
        mine = tuple(fault for name, fault in faults if name in {"", place.name})
        own = settings or RigSettings()
        rigs[place.name] = _rig(place, replace(own, seed=seed + number), mine)
    buses = {bus: [p.name for p in setup.places if p.bus == bus] for bus in setup.buses}
    return SimulatedBench(rigs, buses)


def _fault(order: str, names: Sequence[str]) -> tuple[str, Fault]:
    name, slash, rest = order.rpartition("/")
    fault = read_fault(rest)
    if slash and name not in names:
        found = f"found {shown(order)}{did_you_mean(name, names)}"
        raise UsageError("--fault", found, expected="UNIT/kind@seconds, a unit of the plan")
    if slash and fault.kind in SHARED:
        raise UsageError(
            "--fault",
            f"found {shown(order)}",
            expected=f"{rest}: all units share chamber and table",
        )
    return name, fault


def _rig(place: Place, settings: RigSettings, faults: tuple[Fault, ...]) -> SimulatedRig:
    setup = place.setup
    if not (setup.folder / TRUTH_FILE).is_file():
        raise RefusedError(
            "--bus virtual",
            f"{setup.folder} has no {TRUTH_FILE}",
            expected="simulated units",
            remedy="give the interface of the real rig, as --bus can0",
        )
    truth, _ = read_truth(setup.folder)
    return SimulatedRig(setup.unit, truth, setup.plan, setup.rig, settings, faults)
