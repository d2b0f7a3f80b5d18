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


def hands_of(setup: Setup, source: Source, unattended: bool) -> Hands | None:
    """Hands of a session; nothing is asked or ordered yet.

    Raises
    ------
    RefusedError
        When the plan leaves to a person what must be done alone, or a package is missing.
    """
    rig = source.rig if isinstance(source, SimulatedSource) else None
    equipment = setup.plan.equipment
    by_hand = equipment.chamber_by.by_hand, equipment.positioner_by.by_hand
    if not unattended and (rig is not None or all(by_hand)):
        return Robot(rig) if rig is not None else None
    if rig is not None and all(by_hand):
        return simulated_attendant(setup.plan, rig)
    if rig is not None:
        return attendant(setup.plan, lambda: float(rig.seconds), at_once=True)
    return attendant(setup.plan, time.monotonic, alone=unattended)


@contextlib.contextmanager
def made_safe(hands: object) -> Iterator[None]:
    """Chamber and positioner of an attendant are brought to safety, whatever ends the session.

    Enter it when the session is locked: a process that is refused must not order the chamber of
    the first one.
    """
    try:
        yield
    finally:
        if isinstance(hands, Attendant):
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
