"""Who does what a session wants: nobody, the simulated operator, or the instruments of a plan."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator

import click

from triaxcal.rig.live.attendant import Attendant, attendant
from triaxcal.rig.live.runner import Hands, Robot
from triaxcal.rig.live.simhands import simulated_attendant
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.sources.canbus import SimulatedSource
from triaxcal.rig.sources.source import Source


@contextlib.contextmanager
def hands_of(setup: Setup, source: Source, unattended: bool) -> Iterator[Hands | None]:
    """Hands of a session; chamber and positioner are brought to safety however it ends."""
    rig = source.rig if isinstance(source, SimulatedSource) else None
    equipment = setup.plan.equipment
    by_hand = equipment.chamber_by.by_hand, equipment.positioner_by.by_hand
    if not unattended and (rig is not None or all(by_hand)):
        yield Robot(rig) if rig is not None else None
        return
    if rig is not None and all(by_hand):
        hands = simulated_attendant(setup.plan, rig)
    elif rig is not None:
        hands = attendant(setup.plan, lambda: float(rig.seconds), at_once=True)
    else:
        hands = attendant(setup.plan, time.monotonic, alone=unattended)
    with made_safe(hands):
        yield hands


@contextlib.contextmanager
def made_safe(hands: Attendant) -> Iterator[None]:
    """Chamber and positioner are brought to safety at the end, whatever ends it."""
    try:
        yield
    finally:
        with _uninterrupted():
            _end(hands)


def _end(hands: Attendant) -> None:
    for text in (*hands.notes(), *hands.make_safe()):
        click.echo(text, err=True)


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """A second Ctrl-C does not keep the chamber hot; the last orders end by their time-outs."""
    names = [n for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    before = {n: signal.signal(getattr(signal, n), signal.SIG_IGN) for n in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
