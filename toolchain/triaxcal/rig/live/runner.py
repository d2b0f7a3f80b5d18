"""The loop of a live session: source -> recording -> what the operator should see."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from triaxcal.rig.bus.busload import bits_of
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.records.recording import Recording
from triaxcal.rig.session.events import Command, Event, View
from triaxcal.rig.session.session import Session
from triaxcal.rig.simulated.simulator import SimulatedRig
from triaxcal.rig.sources.source import Source

_RATE_WINDOW_S = 2.0
_NOT_DECODED_S = 3.0


@dataclass(frozen=True)
class Tick:
    """What one pass of the loop brought.

    Attributes
    ----------
    notes : tuple of str
        About the connection; they change no decision.
    done : tuple of str
        What the hands did.
    frames_per_s : float
        By the frames' own times.
    bits_per_s, fast_bits_per_s : float
        At the nominal bit rate, and at that of the data of CAN FD.
    """

    events: tuple[Event, ...]
    notes: tuple[str, ...]
    done: tuple[str, ...]
    frames_per_s: float
    bits_per_s: float
    fast_bits_per_s: float


class Hands(Protocol):
    """Who sets the chamber and turns the unit where no person does."""

    def act(self, session: Session, events: Sequence[Event], /) -> None:
        """Do what the session wants; `events` are new."""

    def notes(self) -> list[str]:
        """What was done since last asked, one line each."""

    def left_s(self, session: Session, /) -> float | None:
        """Predicted seconds to the end; None where nothing is predicted."""

    def shown(self, session: Session, seen: View, /) -> View:
        """View of a session as a person beside the hands should see it."""


class Robot:
    """Operator of the simulated rig: does what the session wants."""

    def __init__(self, rig: SimulatedRig) -> None:
        self._rig = rig

    def act(self, session: Session, _: Sequence[Event] = ()) -> None:
        """Set the chamber, turn the tilter."""
        if session.done:
            return
        self._rig.target_degc = session.target_degc
        if session.reseat is not None:
            self._rig.turn_to("TP1" if session.reseat.position != "TP1" else "TP2")
        elif session.wanted is not None:
            self._rig.turn_to(session.wanted)

    def notes(self) -> list[str]:
        """It says nothing."""
        return []

    def left_s(self, _: Session) -> None:
        """It predicts nothing."""

    def shown(self, _: Session, seen: View) -> View:
        """It is shown what an operator is shown."""
        return seen


def live(
    recording: Recording,
    source: Source,
    words: Callable[[], Sequence[Command]],
    hands: Hands | None = None,
) -> Iterator[Tick]:
    """Run until the session is done; the caller may stop at any tick.

    Raises
    ------
    RefusedError
        When the disk refuses, the rig is not the unit's, or the bus is lost for good.
    """
    session = recording.engine.session
    meter = _Meter()
    while not session.done:
        frames = source.read()
        events = recording.feed(frames)
        now_ns = int(frames.t_ns[-1]) if len(frames) else time.time_ns()
        for word in words():
            events += recording.command(word, now_ns)
        recording.log.flush()
        done: list[str] = []
        if hands is not None:
            try:
                hands.act(session, events)
            finally:
                done = hands.notes()
                for text in done:
                    recording.note(text, now_ns)
        rates = meter.add(frames)
        notes = [*source.notes(), *meter.notes(session)]
        yield Tick(tuple(events), tuple(notes), tuple(done), *rates)


class _Meter:
    """Frames and bits a second over the last two seconds; frames that make no samples."""

    def __init__(self) -> None:
        self._parts: deque[tuple[int, int, float, float]] = deque()
        self._block_at = time.monotonic()
        self._index: int | None = None
        self._frames = 0
        self._told = False

    def add(self, frames: Frames) -> tuple[float, float, float]:
        if len(frames):
            self._parts.append((int(frames.t_ns[-1]), len(frames), *bits_of(frames)))
            self._frames += len(frames)
        while self._parts and self._parts[-1][0] - self._parts[0][0] > _RATE_WINDOW_S * 1e9:
            self._parts.popleft()
        if len(self._parts) < 2:
            return 0.0, 0.0, 0.0
        seconds = max((self._parts[-1][0] - self._parts[0][0]) / 1e9, 1e-3)
        # The first part's frames came before its time stamp.
        counts, bits, fast = zip(*(part[1:] for part in list(self._parts)[1:]), strict=True)
        return sum(counts) / seconds, sum(bits) / seconds, sum(fast) / seconds

    def notes(self, session: Session) -> list[str]:
        """One line when frames come that are not the rig's."""
        index = session.previous.index if session.previous else None
        if index != self._index:
            self._index, self._block_at, self._frames = index, time.monotonic(), 0
            self._told = False
        if self._told or not self._frames or time.monotonic() - self._block_at < _NOT_DECODED_S:
            return []
        self._told = True
        said = (
            f"{self._frames} frames and no sample among them: wrong DBC or layout, another rig, "
            "or two nodes with one ID; try `triaxcal rig check`"
        )
        return [said]
