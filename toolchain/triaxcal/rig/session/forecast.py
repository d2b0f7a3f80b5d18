"""How long a run takes: predicted from the plan, corrected by what has been seen of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.equilibrium import window_s
from triaxcal.rig.session.events import Event
from triaxcal.rig.session.phases import Learning, Warming
from triaxcal.rig.session.session import Session


def settle_s(plan: SessionPlan, from_degc: float, to_degc: float) -> float:
    """Predicted seconds from one temperature to the equilibrium at another.

    The chamber moves at its slew v for R = |dT| / v. The unit follows with tau and lags by
    L = v tau (1 - exp(-R / tau)) at the end, by |dT| where the chamber jumps. Its mean slope over
    the window W is L (exp(W / tau) - 1) exp(-t / tau) / W at t after that.
    """
    chamber, thermal = plan.equipment.chamber, plan.thermal
    change, tau, window = abs(to_degc - from_degc), chamber.tau_s, float(window_s(thermal))
    slew = chamber.slew_k_per_min / 60.0
    ramp, lag = 0.0, change
    if slew:
        ramp = change / slew
        lag = slew * tau * -math.expm1(-ramp / tau)
    limit = thermal.slope_max_k_per_min / 60.0
    spread = lag * math.expm1(window / tau) / window
    slope = tau * math.log(spread / limit) if spread > limit else 0.0
    near = tau * math.log(lag / thermal.tolerance_k) if lag > thermal.tolerance_k else 0.0
    return ramp + max(window, slope, near)


class _Pace:
    """Ratio of the time that something took to what was predicted, over all so far."""

    def __init__(self) -> None:
        self._took = self._predicted = 0.0

    def add(self, took_s: float, predicted_s: float) -> None:
        self._took += took_s
        self._predicted += predicted_s

    @property
    def ratio(self) -> float:
        return self._took / self._predicted if self._predicted else 1.0


class Forecast:
    """Time left of a session.

    Parameters
    ----------
    start_degc : float
        Temperature that it begins at.
    """

    def __init__(self, plan: SessionPlan, start_degc: float) -> None:
        self._plan = plan
        self._start_degc = start_degc
        self._warm, self._dwell = _Pace(), _Pace()
        self._since: float | None = None
        self._step = -1

    def see(self, now_s: float, session: Session, events: Sequence[Event]) -> bool:
        """Take what happened; whether it changes what is left by more than the time that went."""
        if self._since is None or session.step != self._step:
            self._since, self._step = now_s, session.step
        changed = False
        for event in events:
            if event.kind not in {"reference", "equilibrium", "accepted"}:
                continue
            took = now_s - self._since
            if event.kind == "equilibrium":
                self._warm.add(took, self._settle_s(event.step))
            elif event.kind == "accepted":
                self._dwell.add(took, self._position_s)
            self._since, changed = now_s, True
        return changed

    def left_s(self, now_s: float, session: Session) -> float:
        """Predicted seconds to the end."""
        if session.done:
            return 0.0
        here = now_s - self._since if self._since is not None else 0.0
        left = 0.0
        if isinstance(session.phase, Learning):
            left += max(0.0, self._plan.stillness.reference_s - here)
            here = 0.0
        if isinstance(session.phase, Learning | Warming):
            wait = self._settle_s(session.step) * self._warm.ratio
            left += max(wait - here, session.thermometer.left_s or 0.0, 0.0)
            here = 0.0
        position = self._position_s * self._dwell.ratio
        left += max(len(session.pending) * position - here, 0.0)
        for i, step in enumerate(self._plan.steps[session.step + 1 :], session.step + 1):
            left += self._settle_s(i) * self._warm.ratio + len(step.positions) * position
        return left

    @property
    def _position_s(self) -> float:
        settings = self._plan.stillness
        dwell = settings.clean_blocks + settings.settle_s + settings.average_s + settings.guard_s
        return self._plan.equipment.positioner.turn_s + dwell

    def _settle_s(self, step: int) -> float:
        steps = self._plan.steps
        before = steps[step - 1].temp_degc if step else self._start_degc
        return settle_s(self._plan, before, steps[step].temp_degc)


def duration(seconds: float) -> str:
    """Seconds in words: "3 h 05 min"."""
    minutes = math.ceil(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
