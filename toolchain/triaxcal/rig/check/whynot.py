"""Why a log does not hold a whole session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.check.census import Census
from triaxcal.rig.check.check import beginning, noise
from triaxcal.rig.logs.linelog import frames_of_log
from triaxcal.rig.logs.logfile import Left
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.session.events import Event
from triaxcal.rig.session.session import Session

_BEGINNING_S = 5.0


@dataclass(frozen=True)
class WhyNot:
    """What is said of a log that does not hold a whole session.

    Attributes
    ----------
    found : str
        In the refusal, one line.
    lines : tuple of str
        What was counted, a line each.
    """

    found: str
    lines: tuple[str, ...]


def why_not(setup: Setup, log: Path, session: Session, events: Sequence[Event]) -> WhyNot:
    """Why a log that has been played does not hold a whole session; reads the log again.

    Raises
    ------
    RefusedError
        When the log cannot be read.
    """
    census, first = Census(setup.rig), list[Frames]()
    left = Left()
    for parsed in frames_of_log(log, setup.rig.lines):
        left.add(parsed)
        census.add(parsed.frames)
        if len(parsed.frames) and not first:
            first.append(beginning(parsed.frames, _BEGINNING_S))
    faults = census.faults()
    if first:
        samples = setup.decoder().feed(concatenate(first))
        shaken = noise(setup, samples) if len(samples.number) > 1 else None
        if shaken is not None and shaken.good is False:
            faults.append(f"first {_BEGINNING_S:g} s: {shaken.text}")
    restless = [f"not at rest in {n} s: {reason}" for n, reason in session.restless.values()]
    tried = sum(event.kind == "refused" for event in events)
    to_accept = sum(len(step.positions) for step in setup.plan.steps)
    found = f"holds {len(session.accepted)} accepted dwells of the plan's {to_accept}"
    found += f", {tried} refused" if tried else ""
    if not census.frames:
        ends = "no frames in it" + (f"; its first line is {left.first}" if left.first else "")
    elif session.reference is None:
        ends = (
            f"{setup.plan.stillness.reference_s} s of rest in a row, to learn the noise, never came"
        )
    else:
        ends = f"it ends at: {view(session).headline}"
    causes = [*faults, *restless][:3]
    return WhyNot("; ".join([found, *causes, ends]), (*census.said(), *faults, *restless))
