"""Many units on one tilter: one order for all, one decision a dwell and unit.

Each unit has a session of its own, which decides by the unit's frames alone. The group decides
what all of them wait for: the temperature of the slowest, and the position. A visit to a position
ends when every unit that needs it has been accepted, or must leave it, or the time of two dwells
has passed. A unit that failed `attempts` visits in a row is set aside with its reason; the others
go on. What happens to most units alike is the fault of the chamber or the tilter, and sets nobody
aside.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.many.member import Aside, Member, Told
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.phases import Learning, Warming

GroupStage = Literal["reference", "temperature", "turn", "dwell", "done"]
_VISIT = "visit"
_SLACK_S = 15.0
"""Beyond two dwells: blocks of one second, and the first of them after a turn."""


@dataclass
class _Visit:
    """A position that is taken up.

    Attributes
    ----------
    refused : dict
        What was refused in it, by unit.
    """

    position: str
    arrived_s: float | None = None
    refused: dict[str, str] = field(default_factory=dict)


class Group:
    """Units of one session.

    Parameters
    ----------
    follow : bool
        A position that most units are measured in already becomes the one that is wanted: where a
        person turns.

    Attributes
    ----------
    position : str
        Position for all.
    stop : str
        Why the session cannot go on without a person; "" while it can.
    """

    def __init__(self, plan: SessionPlan, members: Sequence[Member], follow: bool = True) -> None:
        self.plan = plan
        self.members = tuple(members)
        self.follow = follow
        self.stop = ""
        self._limits = plan.equipment.limits
        self._visit: _Visit | None = None
        self._phase: tuple[int, GroupStage] | None = None
        self._since_s = 0.0
        self._start_s: float | None = None
        self.position = plan.steps[0].positions[0]
        if self.active:
            self.position = self._next(self.plan.steps[self.step].positions[0])

    # ---- what is seen ----

    @property
    def active(self) -> list[Member]:
        """Units still to be measured."""
        return [m for m in self.members if m.active]

    @property
    def done(self) -> bool:
        """Nothing is left to be measured."""
        return not self.active

    @property
    def step(self) -> int:
        """Step of the slowest units."""
        return min(m.session.step for m in self.active)

    @property
    def behind(self) -> list[Member]:
        """The slowest units: those that the others wait for."""
        return [m for m in self.active if m.session.step == self.step]

    @property
    def target_degc(self) -> float:
        """Temperature for all."""
        return self.plan.steps[self.step].temp_degc

    @property
    def temp_degc(self) -> float | None:
        """Median of the units' temperatures."""
        known = [m.session.temp_degc for m in self.active if m.session.temp_degc is not None]
        return float(np.median(known)) if known else None

    @property
    def seen(self) -> str | None:
        """Position that more than half of the units that are heard show."""
        shown = [m.session.seen for m in self.active if m.heard_s is not None]
        if not shown:
            return None
        position, count = Counter(shown).most_common(1)[0]
        return position if 2 * count > len(shown) else None

    @property
    def stage(self) -> GroupStage:
        """What is waited for."""
        if self.done:
            return "done"
        phases = [m.session.phase for m in self.behind]
        if any(isinstance(phase, Learning) for phase in phases):
            return "reference"
        if any(isinstance(phase, Warming) for phase in phases):
            return "temperature"
        return "dwell" if self.seen == self.position else "turn"

    @property
    def visit_s(self) -> float:
        """Longest visit to a position."""
        settings = self.plan.stillness
        dwell = settings.clean_blocks + settings.settle_s + settings.average_s + settings.guard_s
        return 2.0 * dwell + _SLACK_S

    # ---- what goes on ----

    def look(self, now_s: float, told: Sequence[Told]) -> list[Aside]:
        """Take what happened; units that are set aside now, with the reason.

        Raises
        ------
        RefusedError
            When a unit is silent from the start.
        """
        if self._start_s is None:
            self._start_s = now_s
        self.stop = ""
        self._hear(now_s)
        failed = self._count(told)
        asides = [*failed, *self._silent(now_s), *self._late(now_s)]
        for member, reason in asides:
            member.aside = member.aside or reason
        if not self.done and self.stage in {"turn", "dwell"}:
            ended = self._visited(now_s)
            for member, reason in ended:
                member.aside = reason
            asides += ended
        elif self._visit is not None:
            self._visit = None
        return list({member.name: (member, reason) for member, reason in asides}.values())

    def _hear(self, now_s: float) -> None:
        for member in self.active:
            block = member.session.previous
            if block is None or block.index == member.index:
                continue
            member.index, member.heard_s = block.index, now_s
            if block.temp_code is not None:
                member.temp_s = now_s

    def _count(self, told: Sequence[Told]) -> list[Aside]:
        """Failures that are no matter of a visit."""
        asides = []
        for member, event in told:
            if event.dwell is not None:
                member.failed.pop((event.step, _VISIT), None)
            if event.kind == "refused":
                member.last = event.text
                if self._visit is not None:
                    self._visit.refused[member.name] = event.text
            if event.kind in {"superseded", "left"}:
                what = "temperature" if event.kind == "left" else event.text.split()[0]
                asides += self._fail(member, event.step, what, event.text)
        return asides

    def _fail(self, member: Member, step: int, what: str, reason: str) -> list[Aside]:
        member.failed[step, what] += 1
        member.last = reason
        times, most = member.failed[step, what], self._limits.attempts
        if times < most:
            return []
        at = f"at {self.plan.steps[step].temp_degc:g} degC"
        text = f"{at} {times} times, the last time: {reason}"
        active = self.active
        alike = sum(m.failed[step, what] >= most - 1 for m in active)
        if len(active) > 1 and 2 * alike > len(active):
            self.stop = f"{alike} units {text}"
            return []
        return [(member, text)]

    def _silent(self, now_s: float) -> list[Aside]:
        """Units without readings while others of their bus have some."""
        limit = self._limits.silence_max_s
        assert self._start_s is not None
        start = self._start_s

        def mute(member: Member) -> bool:
            return now_s - (start if member.heard_s is None else member.heard_s) > limit

        asides: list[Aside] = []
        active = self.active
        for bus in dict.fromkeys(m.place.bus for m in active):
            here = [m for m in active if m.place.bus == bus]
            silent = [m for m in here if mute(m)]
            if len(silent) == len(here) and (len(here) > 1 or len(here) == len(active)):
                # A bus is one plug: its units are whole, and may be gone on with.
                self.stop = f"no readings from {bus} for {limit:g} s"
                continue
            asides += [(m, f"no readings for {limit:g} s") for m in silent]
        never = [m for m, _ in asides if m.heard_s is None]
        if never and not any(m.session.reference for m in self.members):
            ids = ", ".join(
                f"{use.name} {use.layout.can_id:#x}"
                for use in never[0].place.setup.rig.messages.values()
            )
            raise RefusedError(
                f"{never[0].place.bus}, {', '.join(m.name for m in never)}",
                f"no readings for {limit:g} s ({ids})",
                remedy="connect the unit, correct the plan, or take the unit out of it",
            )
        heard = [m for m in active if not mute(m)]
        for member in heard:
            if now_s - (member.temp_s or start) > limit + self._limits.still_max_s:
                asides.append((member, "no temperature"))
        return asides

    def _late(self, now_s: float) -> list[Aside]:
        """Units that take too long to learn their noise, or for an equilibrium."""
        if self.done:
            return []
        stage = self.stage
        phase = (self.step, stage)
        if phase != self._phase:
            self._phase, self._since_s = phase, now_s
        waited = now_s - self._since_s
        if stage == "reference":
            limit = self.plan.stillness.reference_s + self._limits.still_max_s
            late = [m for m in self.behind if isinstance(m.session.phase, Learning)]
            what = f"the noise at rest was not learned within {limit:g} s"
        elif stage == "temperature":
            limit = self.plan.equipment.chamber.settle_max_s
            late = [m for m in self.behind if isinstance(m.session.phase, Warming)]
            what = f"no equilibrium at {self.target_degc:g} degC within {limit:g} s"
        else:
            return []
        if waited <= limit:
            return []
        if len(late) == len(self.active):
            self.stop = what
            return []
        return [(m, what + m.unrest) for m in late]

    def _visited(self, now_s: float) -> list[Aside]:
        """Go on with the visit, or end it; units that failed for good."""
        if self._visit is None:
            self.position = self._next(self.position)
            self._visit = _Visit(self.position)
        visit = self._visit
        if self.follow:
            self._follow(visit)
        if self.seen != visit.position:
            visit.arrived_s = None
            return []
        if visit.arrived_s is None:
            visit.arrived_s, visit.refused = now_s, {}
        behind = self.behind
        waiting = [m for m in behind if m.takes(visit.position)]
        if waiting and now_s - visit.arrived_s <= self.visit_s:
            return []
        asides = []
        for member in behind:
            refused = visit.refused.get(member.name)
            if member in waiting or (refused and visit.position in member.session.pending):
                reason = refused or f"{visit.position}: {member.why_not(visit.position)}"
                asides += self._fail(member, member.session.step, _VISIT, reason)
        self._visit = None
        gone = {m.name for m, _ in asides}
        if any(m.name not in gone for m in self.active):
            self.position = self._next(self._after(visit.position))
        return asides

    def _follow(self, visit: _Visit) -> None:
        """Take up the position that most units are measured in."""
        behind = self.behind
        found = Counter(m.session.phase.position for m in behind).most_common(1)[0]
        position, count = found
        if position is not None and position != visit.position and 2 * count > len(behind):
            self.position = visit.position = position
            visit.arrived_s = None

    def _after(self, position: str) -> str:
        """Position that follows in the plan."""
        positions = self.plan.steps[self.step].positions
        at = positions.index(position) + 1 if position in positions else 0
        return positions[at % len(positions)]

    def _next(self, first: str) -> str:
        """First position from here on that a unit takes; any other one when all must leave it."""
        positions = self.plan.steps[self.step].positions
        at = positions.index(first) if first in positions else 0
        order = (*positions[at:], *positions[:at])
        behind = self.behind
        takes = (p for p in order if any(m.takes(p) for m in behind))
        return next(takes, next((p for p in order if p != self.position), first))
