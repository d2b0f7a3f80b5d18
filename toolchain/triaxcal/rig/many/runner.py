"""The loop of a live session of many units."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from triaxcal.rig.many.group import Group
from triaxcal.rig.many.member import Member
from triaxcal.rig.many.recording import ManyRecording
from triaxcal.rig.many.simbench import SimulatedBench
from triaxcal.rig.session.events import Command, Event
from triaxcal.rig.sources.gather import Gathered


@dataclass(frozen=True)
class ManyTick:
    """What one pass of the loop brought.

    Attributes
    ----------
    asides : tuple of Member
        Units that were set aside.
    notes : tuple of str
        About the connections.
    done : tuple of str
        What the hands did.
    t_ns : int
        By the frames' own times.
    """

    told: tuple[tuple[Member, Event], ...]
    asides: tuple[Member, ...]
    notes: tuple[str, ...]
    done: tuple[str, ...]
    t_ns: int


class ManyHands(Protocol):
    """Who sets the chamber and turns the tilter where no person does."""

    def act(self, group: Group, told: Sequence[tuple[Member, Event]], /) -> None:
        """Do what the group wants."""

    def notes(self) -> list[str]:
        """What was done since last asked, one line each."""

    def left_s(self, group: Group, /) -> float | None:
        """Predicted seconds to the end; None where nothing is predicted."""


class ManyRobot:
    """Operator of the simulated bench: does what the group wants."""

    def __init__(self, bench: SimulatedBench) -> None:
        self._bench = bench

    def act(self, group: Group, _: Sequence[tuple[Member, Event]] = ()) -> None:
        """Set the chamber, turn the tilter."""
        if not group.done:
            self._bench.target_degc = group.target_degc
            self._bench.turn_to(group.position)

    def notes(self) -> list[str]:
        """It says nothing."""
        return []

    def left_s(self, _: Group) -> None:
        """It predicts nothing."""


def live_many(
    taken: ManyRecording,
    sources: Gathered,
    words: Callable[[], Sequence[Command]],
    hands: ManyHands | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[ManyTick]:
    """Run until every unit is done or set aside; the caller may stop at any tick.

    Parameters
    ----------
    clock : callable
        Seconds from any moment on; those of the readings where the bench is simulated.

    Raises
    ------
    RefusedError
        When the disk refuses, a unit is another one or silent at the start, or a bus is lost.
    """
    group = taken.group
    known = {m.name for m in group.members if m.aside}
    t_ns = time.time_ns()
    while not group.done:
        told: list[tuple[Member, Event]] = []
        for bus, frames in sources.read():
            told += taken.feed(bus, frames)
            if len(frames):
                t_ns = int(frames.t_ns[-1])
        for word in words():
            told += taken.command(word, t_ns)
        taken.flush()
        for member, reason in group.look(clock(), told):
            taken.put_aside(member, reason, t_ns)
        asides = [m for m in group.members if m.aside and m.name not in known]
        known |= {m.name for m in asides}
        done: list[str] = []
        if hands is not None:
            try:
                hands.act(group, told)
            finally:
                done = hands.notes()
                for text in done:
                    taken.note(text, t_ns)
        yield ManyTick(tuple(told), tuple(asides), tuple(sources.notes()), tuple(done), t_ns)
