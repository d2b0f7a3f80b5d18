"""The guided session: blocks and commands in, decisions out. No clock, no file, no screen.

The same blocks and commands give the same decisions, live or replayed.
"""

from __future__ import annotations

from collections.abc import Sequence

from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.events import Agree, Command, Event
from triaxcal.rig.session.faults import complaint, fault
from triaxcal.rig.session.phases import Done, Learning, Phase, Warming
from triaxcal.rig.session.state import State
from triaxcal.rig.session.stillness import motion


class Session(State):
    """State of one session, and the phase that it is in."""

    phase: Phase

    def restart(self) -> None:
        """Everything but the durable events anew."""
        super().restart()
        if self.reference is None:
            self.phase = Learning()
        elif self.done:
            self.phase = Done()
        else:
            known = [e for e in self.durable if e.kind == "equilibrium" and e.step == self.step]
            self.phase = Warming(known[-1].temp_degc if known else None)

    def restore(self, durable: Sequence[Event]) -> None:
        """Go on after a crash: as a session made from these durable events would."""
        self.durable = list(durable)
        self.restart()

    @property
    def wanted(self) -> str | None:
        """Position that the tilter should be in."""
        return self.phase.position or (self.pending[0] if self.pending else None)

    def on_block(self, block: Block) -> list[Event]:
        """Decisions after one more second."""
        self.events = []
        before = self.previous
        self.lost += block.lost
        self.bad_crc += block.trouble.bad_crc
        self.repeated += block.trouble.duplicates
        self.invalid += block.trouble.invalid
        if before is not None and block.index > before.index + 1:
            self.gaps.append((before.index, block.index - before.index - 1))
        wrong = fault(block, before, self.plan, self.fine)
        limits, scale = self.plan.stillness, self.micro_g_per_code
        self.unrest = wrong or motion(
            block, before, self.reference, limits, scale, step_code=self.step_code
        )
        if self.unrest is not None:
            count, first = self.restless.get(self.unrest.why, (0, self.unrest))
            self.restless[self.unrest.why] = count + 1, first
        if found := wrong or complaint(block):
            self.say("trouble", block.t_ns, str(found), reasons=(found,))
        self.look(block)
        if self.phase.position is None:
            self.rest = [] if self.unrest else [*self.rest, block][-limits.clean_blocks :]
        again = True
        while again:
            self.phase, again = self.phase.on_block(self)
        return self.events

    def on_command(self, command: Command, t_ns: int) -> list[Event]:
        """Decisions after a word of the operator."""
        self.events = []
        if not isinstance(command, Agree):
            self._redo(command.position, t_ns)
        elif self.offered is None:
            self.say("refused", t_ns, "no position is offered")
        else:
            self.agreed = self.offered
        return self.events

    def _redo(self, position: str, t_ns: int) -> None:
        if position not in (*TEST_POSITIONS, *CHECK_POSITIONS):
            self.say("refused", t_ns, f"no position {position!r}")
            return
        for step in (self.step, self.step - 1):
            old = self.accepted.get((step, position))
            temp = self.temp_degc
            if old is None or temp is None:
                continue
            if not self.within_span(temp, old.temp_degc):
                text = f"{position}: the temperature is no longer {old.temp_degc:.2f} degC"
                self.say("refused", t_ns, text)
                return
            if step != self.step:
                # A dwell under way was of the step that is left.
                self.step, self.phase = step, Warming(old.temp_degc)
            self.redo.add(position)
            self.say("found", t_ns, f"{position} will be measured again")
            return
        self.say("refused", t_ns, f"{position} has not been accepted at this temperature")
