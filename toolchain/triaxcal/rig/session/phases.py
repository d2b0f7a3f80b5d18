"""Phases of a session: what each waits for, and which one comes next.

reference -> temperature -> turn -> still -> settle -> average -> guard -> accepted, or refused
and again.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

from triaxcal.rig.hands.orientation import described
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.events import AcceptedDwell, Stage
from triaxcal.rig.session.reasons import Reason, Why, because, when_of
from triaxcal.rig.session.state import Reseat, State
from triaxcal.rig.session.stillness import average, make_reference, refusals


class Phase(ABC):
    """One phase.

    Attributes
    ----------
    position : str or None
        Position whose dwell is under way.
    """

    position: str | None = None

    @abstractmethod
    def on_block(self, state: State, /) -> tuple[Phase, bool]:
        """Decide on one more second; the next phase, and whether that looks at it as well."""

    @abstractmethod
    def progress(self, state: State, /) -> tuple[Stage, int, int]:
        """What the operator sees of it: stage, seconds done and to do."""


@dataclass
class Learning(Phase):
    """Learns the noise at rest, once."""

    blocks: list[Block] = field(default_factory=list)

    def on_block(self, state: State, /) -> tuple[Phase, bool]:
        """Go on when enough seconds of rest have come."""
        block, settings = _now(state), state.plan.stillness
        if state.unrest:
            self.blocks.clear()
        else:
            self.blocks.append(block)
        if len(self.blocks) < settings.reference_s:
            return self, False
        found = make_reference(self.blocks, settings, state.step_code)
        if isinstance(found, int):
            self.blocks = self.blocks[found + 1 :]
            return self, False
        state.reference = found
        sd = (abs(state.micro_g_per_code) * [v**0.5 for v in found.variance]).round(1)
        text = f"noise at rest learned: {sd[0]:g}, {sd[1]:g}, {sd[2]:g} micro-g on x, y, z"
        state.say("reference", block.t_ns, text, reference=found)
        return Warming(), True

    def progress(self, state: State, /) -> tuple[Stage, int, int]:
        """Seconds of rest so far."""
        return "reference", len(self.blocks), state.plan.stillness.reference_s


@dataclass
class Warming(Phase):
    """Waits for the temperature.

    Attributes
    ----------
    known_degc : float or None
        Temperature of this step at which the unit has been in equilibrium already.
    """

    known_degc: float | None = None

    def on_block(self, state: State, /) -> tuple[Phase, bool]:
        """Go on at an equilibrium near the target."""
        temp = state.temp_degc
        if temp is None or abs(temp - state.target_degc) > state.plan.thermal.tolerance_k:
            return self, False
        if not (state.within_span(temp, self.known_degc) or state.thermometer.rests):
            return self, False
        text = f"equilibrium at {temp:.2f} degC"
        seated = state.seated_degc if state.seated_degc is not None else temp
        if state.seen and state.seen in state.pending and not state.within_span(temp, seated):
            # A slip while the unit waited cannot be detected: there is no dwell before it.
            state.reseat = Reseat(state.seen, because(Why.WARMED, kelvin=abs(temp - seated)))
            text += f"; turn away from {described(state.seen)} and back"
        state.say("equilibrium", _now(state).t_ns, text, temp_degc=temp)
        return Turning(), True

    def progress(self, state: State, /) -> tuple[Stage, int, int]:
        """Seconds of temperatures in the window of the trend."""
        return "temperature", state.thermometer.seconds, state.thermometer.window_s


class Turning(Phase):
    """Waits for a position that is wanted, and for the unit to be still in it."""

    def on_block(self, state: State, /) -> tuple[Phase, bool]:
        """Go on to the dwell of a position, or back when the temperature has left the target."""
        temp, target = state.temp_degc, state.target_degc
        if temp is not None and abs(temp - target) > state.plan.thermal.tolerance_k:
            text = f"{temp:.2f} degC is too far from {target:g} degC; wait"
            state.say("left", _now(state).t_ns, text)
            return Warming(), False
        position = self._chosen(state)
        if position is None:
            return self, False
        state.offered = state.agreed = None
        return Dwelling(position), False

    def _chosen(self, state: State) -> str | None:
        """Position to take now."""
        seen, pending = state.seen, state.pending
        if state.reseat is not None:
            if seen == state.reseat.position:
                return None
            state.reseat = None
        if len(state.rest) < state.plan.stillness.clean_blocks or seen is None:
            state.offered = None
            return None
        if seen in {pending[0], state.agreed}:
            return seen
        if seen not in pending:
            if state.offered != seen:
                state.offered = None
            return None
        t_ns, found, first = _now(state).t_ns, described(seen), pending[0]
        if state.plan.take_out_of_order:
            state.say("found", t_ns, f"found {found} instead of {first}: taken out of order")
            return seen
        if state.offered != seen:
            state.offered = seen
            text = f"found {found}, wanted {described(first)}: accept it (y), or turn"
            state.say("offer", t_ns, text)
        return None

    def progress(self, state: State, /) -> tuple[Stage, int, int]:
        """Seconds at rest in the position that is wanted."""
        if state.seen != state.pending[0] or state.reseat is not None:
            return "turn", 0, 0
        return "still", len(state.rest), state.plan.stillness.clean_blocks


@dataclass
class Dwelling(Phase):
    """Settles, averages and guards in one position; ends accepted or refused."""

    position: str

    def on_block(self, state: State, /) -> tuple[Phase, bool]:
        """Keep the second; refuse at once when the unit moved, judge when all is there."""
        block, (settled, _, end) = _now(state), state.dwell_s
        if state.unrest or state.seen != self.position:
            reason = state.unrest or because(Why.TURNED)
            text = f"{self.position}: {reason} {when_of(len(state.rest) - settled)}, retake"
            state.say("refused", block.t_ns, text, reasons=(reason,))
            state.rest = [] if state.unrest else [block]
            return Turning(), True
        state.rest.append(block)
        return (self if len(state.rest) < end else self._judged(state)), False

    def progress(self, state: State, /) -> tuple[Stage, int, int]:
        """Seconds of the part of the dwell."""
        settings, (settled, averaged, _) = state.plan.stillness, state.dwell_s
        rested = len(state.rest)
        if rested < settled:
            return "settle", rested - settings.clean_blocks, settings.settle_s
        if rested < averaged:
            return "average", rested - settled, settings.average_s
        return "guard", rested - averaged, settings.guard_s

    def _judged(self, state: State) -> Phase:
        """Accept or refuse the dwell."""
        settled, averaged, end = state.dwell_s
        rest, window = state.rest[:end], slice(settled, averaged)
        state.rest = state.rest[-state.plan.stillness.clean_blocks :]
        t_ns, scale = _now(state).t_ns, state.micro_g_per_code
        assert state.reference is not None
        reasons = _loss(rest[window], state) or refusals(
            rest, window, state.reference, state.plan.stillness, scale, step_code=state.step_code
        )
        if reasons:
            text = f"{self.position}: {'; '.join(map(str, reasons))}, retake"
            state.say("refused", t_ns, text, reasons=tuple(reasons))
            # After a slip the unit is misplaced: waiting longer would not help.
            slipped = reasons[0].why is Why.SLIP
            state.reseat = Reseat(self.position, because(Why.SLIPPED)) if slipped else None
            return Turning()
        dwell = self._dwell(state, rest[window])
        u = abs(scale) * dwell.u_code
        text = (
            f"{described(dwell.position)} at {dwell.temp_degc:.2f} degC accepted, "
            f"u(A) {u[0]:.1f}, {u[1]:.1f}, {u[2]:.1f} micro-g"
        )
        state.say("accepted", t_ns, text, dwell=dwell)
        for old in state.accept(dwell):
            gone = f"{old.position} at {old.temp_degc:.2f} degC superseded"
            state.say("superseded", t_ns, gone)
        moved_on = state.advance()
        if state.done:
            state.say("done", t_ns, "every position has been accepted")
            return Done()
        return Warming() if moved_on else Turning()

    def _dwell(self, state: State, blocks: Sequence[Block]) -> AcceptedDwell:
        means = average(
            blocks, state.plan.stillness, state.micro_g_per_code, step_code=state.step_code
        )
        codes = [b.temp_code for b in blocks if b.temp_code is not None]
        temp_code = sum(codes) / len(codes)
        return AcceptedDwell(
            step=state.step,
            position=self.position,
            temp_code=temp_code,
            temp_degc=state.unit.temperature_sensor.degc(temp_code),
            **vars(means),
            start_ns=blocks[0].t_ns,
            end_ns=blocks[-1].t_ns,
            lost=sum(b.lost for b in blocks),
            bad_crc=sum(b.trouble.bad_crc for b in blocks),
        )


class Done(Phase):
    """Every position has been accepted."""

    def on_block(self, _: State, /) -> tuple[Phase, bool]:
        """Nothing is waited for."""
        return self, False

    def progress(self, _: State, /) -> tuple[Stage, int, int]:
        """Nothing to do."""
        return "done", 0, 0


def _loss(blocks: Sequence[Block], state: State) -> list[Reason]:
    lost = sum(b.lost for b in blocks)
    expected = state.plan.rate_hz * len(blocks)
    if lost <= state.plan.stillness.lost_max_ratio * expected:
        return []
    return [because(Why.LOST, lost=lost, expected=expected)]


def _now(state: State) -> Block:
    """The second that is decided on."""
    assert state.previous is not None
    return state.previous
