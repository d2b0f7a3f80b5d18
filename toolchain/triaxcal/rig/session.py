"""The guided session: blocks and commands in, decisions out. No clock, no file, no screen.

reference -> temperature -> turn -> still -> settle -> average -> guard -> accepted, or refused
and again. The same blocks and commands give the same decisions, live or replayed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.rig.blocks import Block
from triaxcal.rig.equilibrium import Trend, trend, window_s
from triaxcal.rig.events import DURABLE, AcceptedDwell, Agree, Command, Event, Redo
from triaxcal.rig.faults import complaint, fault
from triaxcal.rig.orientation import described, recognised
from triaxcal.rig.plan import SessionPlan
from triaxcal.rig.stillness import Reference, average, make_reference, motion, refusals
from triaxcal.unit.description import UnitDescription

_COVERED = 0.9
"""Share of the window's seconds that must have a temperature."""


class Session:
    """State of one session.

    Parameters
    ----------
    history : sequence of Event
        Durable events of the session so far, when it is resumed.
    """

    def __init__(
        self, plan: SessionPlan, unit: UnitDescription, history: Sequence[Event] = ()
    ) -> None:
        self.plan = plan
        self.unit = unit
        self.micro_g_per_code = plan.micro_g_per_code(unit)
        self.durable = [event for event in history if event.kind in DURABLE]
        self.accepted: dict[tuple[int, str], AcceptedDwell] = {}
        self.redo: set[str] = set()
        self.reference: Reference | None = None
        self.step = 0
        self.lost = self.bad_crc = 0
        self.gaps: list[tuple[int, int]] = []  # after which second, how many
        self.last_event = ""
        self._restart()

    def _restart(self) -> None:
        """Everything but the durable events anew."""
        self.accepted = {}
        self.reference = None
        balanced: dict[int, float] = {}
        for event in self.durable:
            if event.dwell is not None:
                self._accept_durable(event.dwell)
            if event.reference is not None:
                self.reference = event.reference
            if event.kind == "equilibrium" and event.temp_degc is not None:
                balanced[event.step] = event.temp_degc
        self.redo = set()
        self.step = 0
        while self.step < len(self.plan.steps) and not self.pending:
            self.step += 1
        self.balanced_degc: float | None = balanced.get(self.step)
        self.at_temperature = False
        self.previous: Block | None = None
        self.seen: str | None = None
        self.offered: str | None = None
        self.agreed: str | None = None
        self.learning: list[Block] = []
        self.rest: list[Block] = []
        self.taking: str | None = None  # position whose dwell is under way
        self.reseat: str | None = None  # position that must be left and taken up anew
        self.reseat_why = ""
        self.seated_degc: float | None = None  # temperature when this position was taken up
        self.temps: deque[tuple[int, float]] = deque()
        self.trends: deque[tuple[int, Trend]] = deque(maxlen=60)

    def resume(self, durable: int) -> None:
        """Go on after a crash: as a session made from the first `durable` events would."""
        del self.durable[durable:]
        self._restart()

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
    def wanted(self) -> str | None:
        """Position that the tilter should be in."""
        return self.taking or (self.pending[0] if self.pending else None)

    @property
    def temp_degc(self) -> float | None:
        """Latest temperature of the unit."""
        return self.temps[-1][1] if self.temps else None

    @property
    def dwell_s(self) -> tuple[int, int, int]:
        """Seconds of rest at which settling, averaging and the guard end."""
        settings = self.plan.stillness
        settled = settings.clean_blocks + settings.settle_s
        return (
            settled,
            settled + settings.average_s,
            settled + settings.average_s + (settings.guard_s),
        )

    def on_block(self, block: Block) -> list[Event]:
        """Decisions after one more second."""
        self.lost += block.lost
        self.bad_crc += block.trouble.bad_crc
        if self.previous is not None and block.index > self.previous.index + 1:
            self.gaps.append((self.previous.index, block.index - self.previous.index - 1))
        events: list[Event] = []
        wrong = fault(block, self.previous, self.plan)
        moved = wrong or motion(
            block,
            self.previous,
            self.reference,
            self.plan.stillness,
            self.micro_g_per_code,
        )
        if told := wrong or complaint(block):
            self._say(events, "trouble", block, told)
        self._take_temperature(block)
        seen = recognised(block.mean, self.micro_g_per_code)
        if seen is None or seen != self.seen or self.seated_degc is None:
            self.seated_degc = self.temp_degc
        self.seen = seen
        self.previous = block
        self._learn(block, moved, events)
        self._rest(block, moved, events)
        if self.reference is not None and not self.done:
            self._temperature(block, events)
            self._positions(block, events)
        return events

    def on_command(self, command: Command, t_ns: int) -> list[Event]:
        """Decisions after a word of the operator."""
        events: list[Event] = []
        if isinstance(command, Agree):
            if self.offered is None:
                self._tell(events, "refused", t_ns, "nothing is offered")
            else:
                self.agreed = self.offered
        else:
            self._redo(command, t_ns, events)
        return events

    # ---- parts of on_block ----

    def _take_temperature(self, block: Block) -> None:
        if self.temps and block.index <= self.temps[-1][0]:
            self.temps.clear()
        if block.temp_code is not None:
            degc = self.unit.temperature_sensor.degc(block.temp_code)
            self.temps.append((block.index, degc))
        window = window_s(self.plan.thermal)
        while self.temps and self.temps[0][0] <= block.index - window:
            self.temps.popleft()
        if len(self.temps) >= _COVERED * window:
            seconds, degrees = zip(*self.temps, strict=True)
            self.trends.append((block.index, trend(seconds, degrees, self.plan.thermal)))
        else:
            self.trends.clear()

    def _learn(self, block: Block, moved: str, events: list[Event]) -> None:
        """Learn the noise at rest, once."""
        if self.reference is not None:
            return
        self.learning = [] if moved else [*self.learning, block]
        if len(self.learning) < self.plan.stillness.reference_s:
            return
        found = make_reference(self.learning, self.plan.stillness)
        if isinstance(found, int):
            self.learning = self.learning[found + 1 :]
            return
        self.reference = found
        self.learning = []
        sd = (abs(self.micro_g_per_code) * [v**0.5 for v in found.variance]).round(1)
        text = f"noise at rest learned: {sd[0]:g}, {sd[1]:g}, {sd[2]:g} micro-g on x, y, z"
        self._say(events, "reference", block, text, reference=found)

    def _rest(self, block: Block, moved: str, events: list[Event]) -> None:
        """Keep the blocks of the present rest; a dwell that is disturbed is refused at once."""
        if not moved and (self.taking is None or self.seen == self.taking):
            self.rest.append(block)
            if self.taking is None:
                del self.rest[: -self.plan.stillness.clean_blocks]
            return
        if self.taking is not None:
            at = len(self.rest) - self.dwell_s[0]
            when = f"at {at} s" if at >= 0 else "while settling"
            reason = moved or "turned away"
            self._say(events, "refused", block, f"{self.taking}: {reason} {when}, retake")
        self.taking = None
        self.rest = [] if moved else [block]

    def _temperature(self, block: Block, events: list[Event]) -> None:
        target = self.plan.steps[self.step].temp_degc
        settings, temp = self.plan.thermal, self.temp_degc
        if temp is None:
            return
        near = abs(temp - target) <= settings.tolerance_k
        if self.at_temperature:
            if not near and self.taking is None:
                self.at_temperature, self.balanced_degc = False, None
                self._say(events, "left", block, f"{temp:.2f} degC has left {target:g} degC; wait")
            return
        known = self.balanced_degc is not None and (
            abs(temp - self.balanced_degc) <= settings.span_max_k
        )
        if near and (known or (self.trends and self.trends[-1][1].rests(settings))):
            self.at_temperature, self.balanced_degc = True, temp
            text = f"equilibrium at {temp:.2f} degC"
            moved_k = abs(temp - (self.seated_degc if self.seated_degc is not None else temp))
            if self.seen in self.pending and moved_k > settings.span_max_k:
                # A slip while the unit waited has nothing before it to be seen against.
                self.reseat, self.reseat_why = self.seen, f"it went through {moved_k:.0f} K"
                text += f"; {described(self.seen)} is to be left and taken up anew"
            self._say(events, "equilibrium", block, text, temp_degc=temp)

    def _positions(self, block: Block, events: list[Event]) -> None:
        """Choose the position to take; end the dwell that is complete."""
        if not self.at_temperature:
            return
        if self.taking is not None:
            if len(self.rest) >= self.dwell_s[2]:
                self._end_dwell(block, events)
            return
        self._choose(block, events)

    def _choose(self, block: Block, events: list[Event]) -> None:
        pending = self.pending
        if self.reseat is not None:
            if self.seen == self.reseat:
                return
            self.reseat = None
        if len(self.rest) < self.plan.stillness.clean_blocks or self.seen is None:
            self.offered = None
            return
        if self.seen == pending[0] or self.seen == self.agreed:
            self._take(self.seen)
        elif self.seen in pending:
            if self.plan.take_out_of_order:
                text = f"found {described(self.seen)} instead of {pending[0]}: taken out of order"
                self._say(events, "found", block, text)
                self._take(self.seen)
            elif self.offered != self.seen:
                self.offered = self.seen
                text = (
                    f"found {described(self.seen)}, wanted {described(pending[0])}: "
                    "agree to take it now, or turn"
                )
                self._say(events, "offer", block, text)
        elif self.offered != self.seen:
            self.offered = None

    def _take(self, position: str) -> None:
        self.taking, self.offered, self.agreed = position, None, None

    def _end_dwell(self, block: Block, events: list[Event]) -> None:
        settled, averaged, end = self.dwell_s
        settings, position = self.plan.stillness, self.taking
        assert position is not None
        window = slice(settled, averaged)
        blocks = self.rest[window]
        assert self.reference is not None
        assert len(blocks) == averaged - settled
        reasons = self._loss(blocks)
        if not reasons:
            rest = self.rest[:end]
            reasons = refusals(rest, window, self.reference, settings, self.micro_g_per_code)
        self.taking = None
        self.rest = self.rest[-settings.clean_blocks :]
        if reasons:
            self._say(events, "refused", block, f"{position}: {'; '.join(reasons)}, retake")
            # After a slip the unit lies otherwise than it should; resting on would not help.
            self.reseat = position if reasons[0].startswith("slip") else None
            self.reseat_why = "it slipped"
        else:
            self._accept(block, self._dwell(position, blocks), events)

    def _loss(self, blocks: Sequence[Block]) -> list[str]:
        lost = sum(b.lost for b in blocks)
        expected = self.plan.rate_hz * len(blocks)
        if lost <= self.plan.stillness.lost_max_ratio * expected:
            return []
        return [f"{lost} of {expected} samples lost"]

    def _dwell(self, position: str, blocks: Sequence[Block]) -> AcceptedDwell:
        means = average(blocks, self.plan.stillness, self.micro_g_per_code)
        codes = [b.temp_code for b in blocks if b.temp_code is not None]
        temp_code = sum(codes) / len(codes)
        return AcceptedDwell(
            step=self.step,
            position=position,
            temp_code=temp_code,
            temp_degc=self.unit.temperature_sensor.degc(temp_code),
            mean_code=means.mean_code,
            u_code=means.u_code,
            batch_sd_code=means.batch_sd_code,
            batches=means.batches,
            readings=means.readings,
            start_ns=blocks[0].t_ns,
            end_ns=blocks[-1].t_ns,
            lost=sum(b.lost for b in blocks),
            bad_crc=sum(b.trouble.bad_crc for b in blocks),
        )

    def _accept(self, block: Block, dwell: AcceptedDwell, events: list[Event]) -> None:
        u = abs(self.micro_g_per_code) * dwell.u_code
        text = (
            f"{described(dwell.position)} at {dwell.temp_degc:.2f} degC accepted, "
            f"u(A) {u[0]:.1f}, {u[1]:.1f}, {u[2]:.1f} micro-g"
        )
        before = dict(self.accepted)
        event = self._say(events, "accepted", block, text, dwell=dwell)
        self._accept_durable(dwell)
        self.redo.discard(dwell.position)
        self.durable.append(event)
        for key, old in before.items():
            if key not in self.accepted or key == (dwell.step, dwell.position):
                gone = f"{old.position} at {old.temp_degc:.2f} degC superseded"
                self._say(events, "superseded", block, gone)
        while not self.done and not self.pending:
            self.step += 1
            self.at_temperature, self.balanced_degc = False, None
        if self.done:
            self._say(events, "done", block, "every position has been accepted")

    def _accept_durable(self, dwell: AcceptedDwell) -> None:
        """Put a dwell in place; of its step, those too far in temperature are to be redone."""
        far = [
            key
            for key, old in self.accepted.items()
            if key[0] == dwell.step
            and abs(old.temp_degc - dwell.temp_degc) > self.plan.thermal.span_max_k
        ]
        for key in far:
            del self.accepted[key]
        self.accepted[dwell.step, dwell.position] = dwell

    # ---- commands and words ----

    def _redo(self, command: Redo, t_ns: int, events: list[Event]) -> None:
        position = command.position
        if position not in (*TEST_POSITIONS, *CHECK_POSITIONS):
            self._tell(events, "refused", t_ns, f"no position {position!r}")
            return
        for step in (self.step, self.step - 1):
            old = self.accepted.get((step, position))
            temp = self.temp_degc
            if old is None or temp is None:
                continue
            if abs(temp - old.temp_degc) > self.plan.thermal.span_max_k:
                text = f"{position}: its temperature, {old.temp_degc:.2f} degC, has passed"
                self._tell(events, "refused", t_ns, text)
                return
            if step != self.step:
                self.step, self.at_temperature, self.balanced_degc = step, False, old.temp_degc
            self.redo.add(position)
            self._tell(events, "found", t_ns, f"{position} will be taken again")
            return
        self._tell(events, "refused", t_ns, f"{position} has not been accepted at this temperature")

    def _say(  # noqa: PLR0917
        self,
        events: list[Event],
        kind: str,
        block: Block,
        text: str,
        dwell: AcceptedDwell | None = None,
        reference: Reference | None = None,
        temp_degc: float | None = None,
    ) -> Event:
        event = Event(kind, block.t_ns, text, self.step, dwell, reference, temp_degc)
        events.append(event)
        self.last_event = text
        if kind in {"reference", "equilibrium"}:
            self.durable.append(event)
        return event

    def _tell(self, events: list[Event], kind: str, t_ns: int, text: str) -> None:
        events.append(Event(kind, t_ns, text, self.step))
        self.last_event = text
