"""Chamber and positioner of the simulated rig, as instruments that an attendant speaks to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.equipment import TEMP_UNITS, Positioner
from triaxcal.rig.hands.instrument import Order
from triaxcal.rig.live.attendant import Attendant
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.simulated.simorders import Fault
from triaxcal.rig.simulated.simulator import RigSettings


class Equipped(Protocol):
    """What chamber and table are of: one simulated rig, or many on one table."""

    target_degc: float

    @property
    def settings(self) -> RigSettings:
        """How chamber and table behave."""

    @property
    def seconds(self) -> int:
        """Seconds simulated so far."""

    @property
    def position(self) -> str:
        """Position of the table."""

    @property
    def turning(self) -> bool:
        """A turn is under way, or has stopped half way."""

    @property
    def chamber_degc(self) -> float:
        """True temperature of the chamber."""

    def active(self, kind: str, /) -> Fault | None:
        """Fault of a kind that is in force now."""

    def turn_to(self, position: str, /) -> None:
        """Start a turn."""


class _Simulated:
    """What both share: they may be deaf."""

    def __init__(self, rig: Equipped) -> None:
        self._rig = rig

    def _listen(self) -> None:
        if self._rig.active("deaf"):
            raise RefusedError("simulated instrument", "no answer within 5 s")

    def close(self) -> None:
        """Nothing is open."""


class SimulatedChamber(_Simulated):
    """Sets the chamber of the simulated rig and says what it has, in degC or in kelvin."""

    def write(self, order: Order) -> None:
        """Take a set point."""
        self._listen()
        self._rig.target_degc = float(order.words["degc"])

    def read(self) -> Sequence[float]:
        """Its temperature."""
        self._listen()
        unit = TEMP_UNITS["K" if self._rig.active("kelvin") else "degC"]
        return (unit.of_degc(self._rig.chamber_degc),)


class SimulatedTable(_Simulated):
    """Turns the simulated rig and says where it is."""

    def __init__(self, rig: Equipped, positioner: Positioner) -> None:
        super().__init__(rig)
        self._positioner = positioner

    def write(self, order: Order) -> None:
        """Begin a turn."""
        self._listen()
        self._rig.turn_to(str(order.words["position"]))

    def read(self) -> Sequence[float]:
        """Angles or number of its position; nowhere near while it turns."""
        self._listen()
        at = self._positioner.order(self._rig.position).numbers
        return tuple(value + 45.0 for value in at) if self._rig.turning else at


def simulated_attendant(plan: SessionPlan, rig: Equipped, blind: bool = False) -> Attendant:
    """Attendant of the simulated rig, in its time.

    Parameters
    ----------
    blind : bool
        The positioner cannot be asked: only the readings show where it is.
    """
    equipment, settings = plan.equipment, rig.settings
    tau_s = settings.chamber_tau_s + settings.unit_tau_s
    positioner = replace(equipment.positioner, turn_s=settings.turn_s)
    own = replace(equipment.chamber, tau_s=tau_s)
    plan = replace(plan, equipment=replace(equipment, chamber=own, positioner=positioner))
    chamber, table = SimulatedChamber(rig), SimulatedTable(rig, positioner)
    return Attendant(
        plan,
        (lambda: chamber, True),
        (lambda: table, not blind),
        lambda: float(rig.seconds),
        at_once=True,
    )
