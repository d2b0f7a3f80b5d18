"""What a session knows: dwells, temperatures, the present rest. Its phases read and change it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from triaxcal.rig.hands.orientation import recognised
from triaxcal.rig.plan.nominal import Nominal
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.equilibrium import Thermometer
from triaxcal.rig.session.events import DURABLE, AcceptedDwell, Event, Kind
from triaxcal.rig.session.reasons import Reason, Why
from triaxcal.rig.session.stillness import Reference
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class Reseat:
    """A position that must be left and taken up anew, and why."""

    position: str
    reason: Reason


class State:
    """State of one session.

    Parameters
    ----------
    history : sequence of Event
        Durable events of the session so far, when it is resumed.

    Attributes
    ----------
    accepted : dict
        Dwells that count, by step and position.
    redo : set of str
        Positions of this step to be taken again.
    unrest : Reason or None
        Why the unit was not at rest in the last second.
    rest : list of Block
        The present rest; no more than `clean_blocks` before a dwell.
    seen, offered, agreed : str or None
        Position recognised; offered out of order; agreed to.
    seated_degc : float or None
        Temperature when the position seen was taken up.
    gaps : list of pair of int
        After which second, and how many.
    restless : dict
        By kind of reason, seconds that were not at rest, and the reason of the first.
    """

    def __init__(
        self,
        plan: SessionPlan,
        unit: UnitDescription,
        nominal: Nominal,
        history: Sequence[Event] = (),
    ) -> None:
        self.plan = plan
        self.unit = unit
        self.micro_g_per_code = nominal.micro_g_per_code
        self.zero_code = nominal.zero_code
        self.step_code = nominal.step_code
        self.fine = nominal.fine
        self.durable = [event for event in history if event.kind in DURABLE]
        self.lost = self.bad_crc = self.repeated = self.invalid = 0
        self.gaps: list[tuple[int, int]] = []
        self.restless: dict[Why, tuple[int, Reason]] = {}
        self.last_event = ""
        self.events: list[Event] = []
        self.restart()

    def restart(self) -> None:
        """Everything but the durable events anew."""
        self.accepted: dict[tuple[int, str], AcceptedDwell] = {}
        self.redo: set[str] = set()
        self.reference: Reference | None = None
        self.step = 0
        for event in self.durable:
            if event.dwell is not None:
                self._place(event.dwell)
            self.reference = event.reference or self.reference
        self.advance()
        self.previous: Block | None = None
        self.unrest: Reason | None = None
        self.rest: list[Block] = []
        self.seen: str | None = None
        self.offered: str | None = None
        self.agreed: str | None = None
        self.reseat: Reseat | None = None
        self.seated_degc: float | None = None
        self.thermometer = Thermometer(self.plan.thermal, self.unit.temperature_sensor)

    @property
    def done(self) -> bool:
        """Every position of every step has been accepted."""
        return self.step >= len(self.plan.steps)

    @property
    def pending(self) -> list[str]:
        """Positions of this step still to be taken, in the plan's order."""
        if self.done:
            return []
        positions = self.plan.steps[self.step].positions
        return [p for p in positions if (self.step, p) not in self.accepted or p in self.redo]

    @property
    def target_degc(self) -> float:
        """Temperature of this step."""
        return self.plan.steps[self.step].temp_degc

    @property
    def temp_degc(self) -> float | None:
        """Latest temperature of the unit."""
        return self.thermometer.temp_degc

    @property
    def dwell_s(self) -> tuple[int, int, int]:
        """Seconds of rest at which settling, averaging and the guard end."""
        settings = self.plan.stillness
        settled = settings.clean_blocks + settings.settle_s
        averaged = settled + settings.average_s
        return settled, averaged, averaged + settings.guard_s

    def within_span(self, temp_degc: float, other_degc: float | None) -> bool:
        """Whether positions at two temperatures may belong to one step."""
        return other_degc is not None and (
            abs(temp_degc - other_degc) <= self.plan.thermal.span_max_k
        )

    def look(self, block: Block) -> None:
        """Take the temperature and the position of one more second."""
        self.thermometer.take(block)
        seen = recognised(block.mean - self.zero_code, self.micro_g_per_code)
        if seen is None or seen != self.seen or self.seated_degc is None:
            self.seated_degc = self.temp_degc
        self.seen = seen
        self.previous = block

    def say(self, kind: Kind, t_ns: int, text: str, **more: Any) -> None:
        """Add an event; what must survive a crash is kept besides."""
        event = Event(kind, t_ns, text, self.step, **more)
        self.events.append(event)
        self.last_event = text
        if kind in DURABLE:
            self.durable.append(event)

    def accept(self, dwell: AcceptedDwell) -> list[AcceptedDwell]:
        """Put a new dwell in place; returns those that it supersedes."""
        before = dict(self.accepted)
        self._place(dwell)
        self.redo.discard(dwell.position)
        new = (dwell.step, dwell.position)
        return [old for key, old in before.items() if key not in self.accepted or key == new]

    def _place(self, dwell: AcceptedDwell) -> None:
        """Put a dwell in place; of its step, those too far in temperature are to be redone."""
        for key, old in list(self.accepted.items()):
            if key[0] == dwell.step and not self.within_span(old.temp_degc, dwell.temp_degc):
                del self.accepted[key]
        self.accepted[dwell.step, dwell.position] = dwell

    def advance(self) -> bool:
        """Go to the next step that has positions to be taken; whether there was one to leave."""
        before = self.step
        while not self.done and not self.pending:
            self.step += 1
        return self.step != before
