"""What the operator should see of a session."""

from __future__ import annotations

import numpy as np

from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.rig.hands.orientation import UP, described
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.events import Stage, View
from triaxcal.rig.session.phases import Dwelling, Learning, Turning
from triaxcal.rig.session.session import Session
from triaxcal.rig.session.stillness import slope_micro_g_per_min

_TURN_S = 15
"""What an operator needs to turn the tilter and step back."""
_WARM_UP_S = 1200
"""Guess for a change of temperature that has not begun."""


def view(session: Session) -> View:
    """View of a session as it is."""
    phase, *progress = session.phase.progress(session)
    blocks = _shown_blocks(session)
    numbers = _numbers(session, blocks)
    trend = session.thermometer.trend
    plan = session.plan
    return View(
        phase=phase,
        order=_order(session, phase, progress[0]),
        headline=_headline(session, phase, *progress),
        wanted=session.wanted,
        seen=session.seen,
        offered=session.offered,
        step=session.step,
        steps=len(plan.steps),
        target_degc=None if session.done else session.target_degc,
        progress=(progress[0], progress[1]),
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


def _order(session: Session, phase: Stage, done: int) -> str:
    """What to do, in the letters of `bigtext`."""
    if phase == "done":
        return "DONE"
    if phase == "reference":
        return f"HANDS OFF {session.plan.stillness.reference_s - done}"
    if session.phase.position is not None or phase == "still":
        return f"HANDS OFF {session.dwell_s[2] - len(session.rest)}"
    if session.reseat is not None:
        return f"RESEAT {up_letters(session.reseat.position)}"
    if phase == "temperature" and session.seen == session.wanted:
        return f"WAIT FOR {session.target_degc:g}"
    assert session.wanted is not None
    return f"TURN TO {up_letters(session.wanted)}"


def up_letters(position: str) -> str:
    """Axis that points up in a position, in the letters of `bigtext`."""
    tilted = " TILTED" if position in CHECK_POSITIONS else ""
    return f"{UP['T' + position[1:]]} UP{tilted}"


def _headline(session: Session, phase: Stage, done: int, whole: int) -> str:
    if phase == "done":
        return "DONE - every position has been accepted"
    wanted = described(session.wanted) if session.wanted else ""
    target = session.target_degc
    if session.reseat is not None:
        position, reason = session.reseat.position, session.reseat.reason
        return f"TURN AWAY FROM {described(position)} AND BACK - {reason}"
    if session.offered is not None:
        return f"TURN TO {wanted} - or press y to take {described(session.offered)} now"
    return {
        "reference": f"LEARNING THE NOISE {done}/{whole} s - do not touch",
        "temperature": f"WAIT FOR {target:g} degC - turn to {wanted}, then do not touch",
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
        if position == session.phase.position:
            state = "now"
        elif position in session.redo:
            state = "redo"
        else:
            state = "done" if (session.step, position) in session.accepted else "open"
        states.append((position, state))
    return tuple(states)


def _shown_blocks(session: Session) -> list[Block]:
    learned = session.phase.blocks[-60:] if isinstance(session.phase, Learning) else []
    blocks = session.rest or learned
    if session.phase.position is not None:
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
    means = (np.array([b.mean for b in blocks]) - session.zero_code) * scale
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
    rested = len(session.rest) if session.phase.position is not None else 0
    left = float(dwell * len(session.pending) - rested)
    left += sum(dwell * len(step.positions) + _WARM_UP_S for step in later)
    if isinstance(session.phase, Turning | Dwelling):
        return left
    wait = session.thermometer.left_s
    return left + (_WARM_UP_S if wait is None else wait)


def _triple(values: FloatArray) -> Triple:
    return (float(values[0]), float(values[1]), float(values[2]))
