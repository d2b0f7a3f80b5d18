"""The operator's place in an unattended run: chamber and positioner are told what to do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.rig.hands.chamberhand import ChamberHand
from triaxcal.rig.hands.equipment import Connection
from triaxcal.rig.hands.instrument import Instrument
from triaxcal.rig.hands.link import Link
from triaxcal.rig.hands.orientation import described
from triaxcal.rig.hands.tablehand import TableHand
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.events import Event, View
from triaxcal.rig.session.forecast import Forecast, duration
from triaxcal.rig.session.phases import Warming
from triaxcal.rig.session.session import Session
from triaxcal.rig.session.watch import Watch

_HANDS_OFF = "HANDS OFF"
Open = Callable[[], Instrument]


class Attendant:
    """Sets the chamber and turns the unit, in place of a person or beside one.

    Parameters
    ----------
    chamber, table : pair of callable and bool, or None
        What opens the instrument, and whether it can be asked; None where a person does it.
    clock : callable
        Seconds from any moment on; those of the readings where the rig is simulated.
    at_once : bool
        Instruments are asked in the loop itself: where the time is simulated.
    alone : bool
        No person is there: the run is stopped when it tries or waits too long.
    """

    def __init__(
        self,
        plan: SessionPlan,
        chamber: tuple[Open, bool] | None,
        table: tuple[Open, bool] | None,
        clock: Callable[[], float],
        *,
        at_once: bool = False,
        alone: bool = True,
    ) -> None:
        equipment = plan.equipment
        limits = equipment.limits
        self._plan = plan
        self._clock = clock
        self._said: list[str] = []
        self._last = ""
        self._watch = Watch(plan)
        self._alone = alone
        self.forecast = Forecast(plan, equipment.chamber.safe_degc)

        def link(name: str, open_: Open, timeout_s: float, again_s: float) -> Link:
            return Link(
                name,
                open_,
                timeout_s=timeout_s,
                again_s=again_s,
                attempts=limits.attempts,
                at_once=at_once,
            )

        own, turns = equipment.chamber, equipment.positioner
        self._chamber = None
        if chamber is not None:
            line = link("chamber", chamber[0], own.timeout_s, own.poll_s)
            self._chamber = ChamberHand(own, line, chamber[1], self._say)
        self._table = None
        if table is not None:
            line = link("positioner", table[0], turns.timeout_s, turns.poll_s)
            self._table = TableHand(turns, line, table[1], limits.attempts, self._say)

    def act(self, session: Session, events: Sequence[Event]) -> None:
        """Do what the session wants.

        Raises
        ------
        RefusedError
            When the run cannot go on.
        """
        now_s = self._clock()
        if events:
            self._last = ""
        if self.forecast.see(now_s, session, events) and not session.done:
            self._said.append(f"left: about {duration(self.left_s(session))}")
        if session.done:
            return
        arrived_s = self._table.arrived_s if self._table else None
        reason = self._watch.look(now_s, session, events, arrived_s)
        if reason and self._alone:
            raise RefusedError(
                "unattended run", reason, remedy="what was accepted is kept: `triaxcal rig resume`"
            )
        if session.previous is None:
            return
        rests = any(event.kind == "equilibrium" for event in events)
        self.heat(now_s, session.target_degc, session.temp_degc, rests)
        if self._table is not None and not self._watch.silent(now_s):
            wanted, away = self._positions(session, self._table.told)
            self.turn(now_s, wanted, away, session.seen)

    def heat(self, now_s: float, target_degc: float, temp_degc: float | None, rests: bool) -> None:
        """Tend the chamber.

        Parameters
        ----------
        temp_degc : float or None
            Temperature of the unit.
        rests : bool
            The unit has come to rest at it.

        Raises
        ------
        RefusedError
            As `ChamberHand.tend` and `refuse_disagreement`.
        """
        if self._chamber is None:
            return
        self._chamber.tend(now_s, target_degc, temp_degc)
        if rests and temp_degc is not None:
            self._chamber.refuse_disagreement(temp_degc)

    def turn(self, now_s: float, wanted: str, away: str, seen: str | None) -> None:
        """Tend the positioner, as `TableHand.tend`; nothing where a person turns."""
        if self._table is not None:
            self._table.tend(now_s, wanted, away, seen)

    def say(self, text: str) -> None:
        """Add a line to what was done."""
        self._said.append(text)

    def left_s(self, session: Session) -> float:
        """Predicted seconds to the end."""
        return self.forecast.left_s(self._clock(), session)

    def shown(self, session: Session, seen: View) -> View:
        """View of a session beside which a person has nothing to do, or less."""
        seen = replace(seen, left_s=self.left_s(session), last_event=self._last or seen.last_event)
        if self._table is None or session.done:
            return seen
        doing = {
            "temperature": f"waiting for {session.target_degc:g} degC",
            "turn": f"turning to {described(self._table.told or str(session.wanted))}",
        }.get(seen.phase)
        headline = f"UNATTENDED - {doing}, do not touch" if doing else seen.headline
        order = seen.order if seen.order.startswith(_HANDS_OFF) else _HANDS_OFF
        return replace(seen, order=order, headline=headline)

    def notes(self) -> list[str]:
        """What was done since last asked, one line each."""
        said = list(self._said)
        self._said.clear()
        return said

    def make_safe(self) -> list[str]:
        """Bring chamber and positioner to where they stay; what was done, one line each."""
        hands = [hand for hand in (self._chamber, self._table) if hand is not None]
        return [hand.make_safe() for hand in hands]

    def _say(self, text: str) -> None:
        self._said.append(text)
        self._last = text

    def _positions(self, session: Session, told: str | None) -> tuple[str, str]:
        """Position to go to, and another one to come from."""
        wanted = session.wanted
        if isinstance(session.phase, Warming) and told is not None:
            # A position taken up before the temperature has changed would be taken up again.
            wanted = told
        assert wanted is not None
        others = [p for step in self._plan.steps for p in step.positions if p != wanted]
        if session.reseat is not None and session.reseat.position == wanted:
            return others[0], wanted
        return wanted, others[0]


def attendant(
    plan: SessionPlan,
    clock: Callable[[], float],
    *,
    at_once: bool = False,
    alone: bool = True,
) -> Attendant:
    """Attendant that speaks to the instruments of a plan.

    Raises
    ------
    RefusedError
        When the plan leaves to a person what must be done alone, or a package is missing.
    """
    equipment = plan.equipment
    chamber_by, table_by = equipment.chamber_by, equipment.positioner_by
    if alone and table_by.by_hand:
        raise _by_hand(plan, "positioner")
    if alone and chamber_by.by_hand and len(plan.steps) > 1:
        raise _by_hand(plan, "chamber")
    return Attendant(
        plan,
        _opened(chamber_by, equipment.chamber.timeout_s),
        _opened(table_by, equipment.positioner.timeout_s),
        clock,
        at_once=at_once,
        alone=alone,
    )


def _opened(by: Connection, timeout_s: float) -> tuple[Open, bool] | None:
    if by.by_hand:
        return None
    name = f'driver "{by.driver.name}"'
    refuse_missing_packages(name, by.driver.packages, "instruments")
    return lambda: by.driver.open(by.settings, timeout_s), by.readable


def _by_hand(plan: SessionPlan, table: str) -> RefusedError:
    return RefusedError(
        f"{plan.source}, [{table}] driver",
        'found "operator"',
        expected="a driver: --unattended has nobody to do it",
        remedy=f"name one in [{table}], or run without --unattended",
    )
