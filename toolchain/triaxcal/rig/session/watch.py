"""How often an unattended session tries, and how long it waits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.events import Event
from triaxcal.rig.session.phases import Learning, Turning, Warming
from triaxcal.rig.session.session import Session

_FAILED = {"refused", "superseded", "left"}
"""Kinds of event that cost an attempt."""
_SILENT_S = 3.0


class Watch:
    """Attempts and waits of one session."""

    def __init__(self, plan: SessionPlan) -> None:
        self._limits = plan.equipment.limits
        self._settle_max_s = plan.equipment.chamber.settle_max_s
        self._learn_max_s = plan.stillness.reference_s + self._limits.still_max_s
        self._attempts: Counter[tuple[int, str]] = Counter()
        self._block: int | None = None
        self._heard: float | None = None
        self._phase: tuple[int, type] | None = None
        self._since = 0.0

    def silent(self, now_s: float) -> bool:
        """No readings come at present."""
        return self._heard is None or now_s - self._heard > _SILENT_S

    def look(
        self, now_s: float, session: Session, events: Sequence[Event], arrived_s: float | None
    ) -> str:
        """Why it cannot go on; "" when it can.

        Parameters
        ----------
        arrived_s : float or None
            When the positioner arrived where it is.
        """
        index = session.previous.index if session.previous else None
        if self._heard is None or index != self._block:
            self._block, self._heard = index, now_s
        phase = (session.step, type(session.phase))
        if phase != self._phase:
            self._phase, self._since = phase, now_s
        return (
            self._mute(now_s)
            or self._tried(session, events)
            or self._late(now_s, session, arrived_s)
        )

    def _mute(self, now_s: float) -> str:
        assert self._heard is not None
        limit = self._limits.silence_max_s
        return f"no readings for {limit:g} s" if now_s - self._heard > limit else ""

    def _tried(self, session: Session, events: Sequence[Event]) -> str:
        for event in events:
            if event.dwell is not None:
                del self._attempts[event.step, event.dwell.position]
            if event.kind not in _FAILED:
                continue
            what = event.text.split()[0].rstrip(":") if event.kind != "left" else "temperature"
            self._attempts[event.step, what] += 1
            if self._attempts[event.step, what] >= self._limits.attempts:
                at = f"at {session.plan.steps[event.step].temp_degc:g} degC"
                times = f"{self._limits.attempts} times"
                return f"{at} {times}, the last time: {event.text}"
        return ""

    def _late(self, now_s: float, session: Session, arrived_s: float | None) -> str:
        waited = now_s - self._since
        temp, trend = session.temp_degc, session.thermometer.trend
        if isinstance(session.phase, Warming) and waited > self._settle_max_s:
            slope = f", {trend.slope_k_per_min:+.3f} K/min" if trend else ""
            shown = f"{temp:.2f} degC{slope}" if temp is not None else "no temperature"
            return (
                f"no equilibrium at {session.target_degc:g} degC within "
                f"{self._settle_max_s:g} s: {shown}"
            )
        if isinstance(session.phase, Learning) and waited > self._learn_max_s:
            within = f"within {self._learn_max_s:g} s"
            return f"the noise at rest was not learned {within}{_unrest(session)}"
        if isinstance(session.phase, Turning) and arrived_s is not None:
            rest_s = now_s - max(self._since, arrived_s)
            if rest_s > self._limits.still_max_s:
                return (
                    f"{session.wanted} was not at rest within {self._limits.still_max_s:g} s"
                    f"{_unrest(session)}"
                )
        return ""


def _unrest(session: Session) -> str:
    return f": {session.unrest}" if session.unrest else ""
