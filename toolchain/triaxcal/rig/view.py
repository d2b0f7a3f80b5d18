"""What the operator should see of a session."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.rig.blocks import Block
from triaxcal.rig.equilibrium import time_left_s, window_s
from triaxcal.rig.events import View
from triaxcal.rig.orientation import UP, described
from triaxcal.rig.session import Session
from triaxcal.rig.stillness import slope_micro_g_per_min

_TURN_S = 15
"""What an operator needs to turn the tilter and step back."""
_WARM_UP_S = 1200
"""Guess for a change of temperature that has not begun."""


def view(session: Session) -> View:
    """View of a session as it is."""
    phase = _phase(session)
    blocks = _shown_blocks(session)
    numbers = _numbers(session, blocks)
    trend = session.trends[-1][1] if session.trends else None
    plan = session.plan
    return View(
        phase=phase,
        order=_order(session, phase),
        headline=_headline(session, phase),
        wanted=session.wanted,
        seen=session.seen,
        offered=session.offered,
        step=session.step,
        steps=len(plan.steps),
        target_degc=None if session.done else plan.steps[session.step].temp_degc,
        progress=_progress(session, phase),
        checklist=_checklist(session),
        mean_g=numbers[0],
        sd_micro_g=numbers[1],
        slope_micro_g_per_min=numbers[2],
        u_micro_g=numbers[3],
        temp_degc=session.temp_degc,
        temp_slope_k_per_min=trend.slope_k_per_min if trend else None,
        left_s=_left_s(session),
        lost=session.lost,
        bad_crc=session.bad_crc,
        accepted=len(session.accepted),
        to_accept=sum(len(step.positions) for step in plan.steps),
        last_event=session.last_event,
    )


def _phase(session: Session) -> str:
    if session.done:
        return "done"
    if session.reference is None:
        return "reference"
    if session.taking is not None:
        rested = len(session.rest)
        settled, averaged, _ = session.dwell_s
        if rested < settled:
            return "settle"
        return "average" if rested < averaged else "guard"
    if not session.at_temperature:
        return "temperature"
    return "still" if session.seen == session.wanted and not session.reseat else "turn"


def _progress(session: Session, phase: str) -> tuple[int, int]:
    settings = session.plan.stillness
    settled, averaged, _ = session.dwell_s
    rested = len(session.rest)
    if phase == "reference":
        return len(session.learning), settings.reference_s
    if phase == "temperature":
        return len(session.temps), window_s(session.plan.thermal)
    return {
        "still": (rested, settings.clean_blocks),
        "settle": (rested - settings.clean_blocks, settings.settle_s),
        "average": (rested - settled, settings.average_s),
        "guard": (rested - averaged, settings.guard_s),
    }.get(phase, (0, 0))


def _order(session: Session, phase: str) -> str:
    """What to do, in the letters of `bigtext`."""
    if phase == "done":
        return "DONE"
    if phase == "reference":
        return f"HANDS OFF {session.plan.stillness.reference_s - len(session.learning)}"
    if session.taking is not None or phase == "still":
        return f"HANDS OFF {session.dwell_s[2] - len(session.rest)}"
    if session.reseat is not None:
        return f"RESEAT {_up(session.reseat)}"
    if phase == "temperature" and session.seen == session.wanted:
        return f"WAIT FOR {session.plan.steps[session.step].temp_degc:g}"
    assert session.wanted is not None
    return f"TURN TO {_up(session.wanted)}"


def _up(position: str) -> str:
    tilted = " TILTED" if position.startswith("CP") else ""
    return f"{UP['T' + position[1:]]} UP{tilted}"


def _headline(session: Session, phase: str) -> str:
    if phase == "done":
        return "DONE - every position has been accepted"
    done, whole = _progress(session, phase)
    wanted = described(session.wanted) if session.wanted else ""
    target = session.plan.steps[session.step].temp_degc
    if session.reseat is not None:
        return f"TURN AWAY FROM {described(session.reseat)} AND BACK - {session.reseat_why}"
    if session.offered is not None:
        return f"TURN TO {wanted} - or press y to take {described(session.offered)} now"
    return {
        "reference": f"LEARNING THE NOISE {done}/{whole} s - do not touch",
        "temperature": f"WAIT FOR {target:g} degC - put {wanted}, then do not touch",
        "turn": f"TURN TO {wanted}",
        "still": f"{wanted} FOUND - hands off {done}/{whole} s",
        "settle": f"SETTLING {wanted} {done}/{whole} s - do not touch",
        "average": f"AVERAGING {wanted} {done}/{whole} s - do not touch",
        "guard": f"WATCHING {wanted} {done}/{whole} s - do not touch yet",
    }[phase]


def _checklist(session: Session) -> tuple[tuple[str, str], ...]:
    if session.done:
        return tuple((p, "done") for p in session.plan.steps[-1].positions)
    states = []
    for position in session.plan.steps[session.step].positions:
        if position == session.taking:
            state = "now"
        elif position in session.redo:
            state = "redo"
        else:
            state = "done" if (session.step, position) in session.accepted else "open"
        states.append((position, state))
    return tuple(states)


def _shown_blocks(session: Session) -> list[Block]:
    blocks = session.rest or session.learning[-60:]
    if session.taking is not None:
        blocks = blocks[-session.plan.stillness.average_s :]
    return blocks or ([session.previous] if session.previous else [])


Triple = tuple[float, float, float]


def _numbers(
    session: Session, blocks: list[Block]
) -> tuple[Triple | None, Triple | None, Triple | None, Triple | None]:
    """Mean in g, sd, slope, u of the mean in micro-g; by the nominal scale."""
    if not blocks:
        return None, None, None, None
    scale = session.micro_g_per_code
    means = np.array([b.mean for b in blocks]) * scale
    sd = np.sqrt(np.mean([b.variance for b in blocks], axis=0)) * np.abs(scale)
    slope = u = None
    if len(blocks) >= 3:
        slope = _triple(np.sign(scale) * slope_micro_g_per_min(blocks, scale)[0])
        u = _triple(np.std(means, axis=0, ddof=1) / np.sqrt(len(blocks)))
    return _triple(means.mean(axis=0) * 1e-6), _triple(sd), slope, u


def _left_s(session: Session) -> float | None:
    """Estimate: open positions by their dwells, temperatures by the slope or a guess."""
    if session.done:
        return 0.0
    dwell = session.dwell_s[2] + _TURN_S
    later = session.plan.steps[session.step + 1 :]
    left = float(dwell * len(session.pending) - len(session.rest) * (session.taking is not None))
    left += sum(dwell * len(step.positions) + _WARM_UP_S for step in later)
    if session.at_temperature:
        return left
    if len(session.trends) >= 30:
        (t_before, before), (t_now, now) = session.trends[0], session.trends[-1]
        wait = time_left_s(now, before, t_now - t_before, session.plan.thermal)
        if wait is not None:
            return left + wait
    return left + _WARM_UP_S


def _triple(values: FloatArray) -> Triple:
    return (float(values[0]), float(values[1]), float(values[2]))
