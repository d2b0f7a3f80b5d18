"""Where frames come from: what every source of the bench does, and the registry of their kinds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.base.registry import Registry

if TYPE_CHECKING:
    from triaxcal.rig.bus.busload import BitRates
    from triaxcal.rig.bus.frames import Frames
    from triaxcal.rig.description.lines import LineFormat
    from triaxcal.rig.simulated.simulator import SimulatedRig


class LogEndedError(RefusedError):
    """A log has no more frames."""


FRAMES, LINES, EITHER = "frames", "lines", "either"
WAIT_S = 0.05
PACE_S = 0.02
"""Between two reads: each costs the same for one frame as for a hundred, and the smallest queue,
Debian's 278 frames, holds 31 ms of a full bus."""
_SILENCE_S = 0.9


class Source(Protocol):
    """A stream of frames.

    Attributes
    ----------
    name : str
        Channel, for the log and for messages.
    rates : BitRates or None
        Bit rates of the bus, where they are known.
    """

    name: str
    rates: BitRates | None

    def read(self) -> Frames:
        """Frames that have come; waits a little when there are none."""

    def notes(self) -> list[str]:
        """What happened to the connection since last asked, one line each."""

    def close(self) -> None:
        """Give the channel back."""


class Watched:
    """A connection that notes when frames stay away and when they come again."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.rates: BitRates | None = None
        self._notes: list[str] = []
        self._heard = time.monotonic()
        self._silent = self._down = False

    def notes(self) -> list[str]:
        """What happened to the connection since last asked."""
        said, self._notes = self._notes, []
        return said

    def _watch(self, heard: bool) -> bool:
        """Note a silence or its end; whether it is silent."""
        now = time.monotonic()
        if heard:
            if self._silent or self._down:
                self._notes.append(f"{self.name}: frames come again")
            self._heard, self._silent, self._down = now, False, False
        elif now - self._heard > _SILENCE_S and not self._silent:
            self._silent = True
            self._notes.append(f"{self.name}: no frames; is the rig on, the plug in, the bus up?")
        return self._silent


@dataclass(frozen=True)
class Wanted:
    """What a source is opened with.

    Attributes
    ----------
    bus : str
        Value of --bus.
    fd : bool
        The plan's frames are CAN FD's.
    rig : callable
        Makes the simulated rig.
    lines : LineFormat or None
        Format of lines, where the rig description has one in place of a bus.
    """

    bus: str
    fd: bool
    rig: Callable[[], SimulatedRig]
    lines: LineFormat | None = None


@dataclass(frozen=True)
class SourceKind:
    """A kind of source: an entry of `SOURCES`.

    Attributes
    ----------
    name, label, doc : str
        Name; how --bus names it; what it is.
    takes : callable
        Whether a value of --bus names a source of this kind.
    open : callable
        Opens it; imports the packages that it needs.
    rank : int
        Kinds of a lower one are asked first.
    simulated : bool
        Faults can be ordered.
    speaks : str
        FRAMES, LINES or EITHER: which rig descriptions it serves.
    """

    name: str
    label: str
    doc: str
    takes: Callable[[str], bool]
    open: Callable[[Wanted], Source]
    rank: int = 100
    simulated: bool = False
    speaks: str = FRAMES

    def serves(self, lines: LineFormat | None) -> bool:
        """Whether it gives what a rig description needs: lines of a format, or frames."""
        return self.speaks in {EITHER, FRAMES if lines is None else LINES}


SOURCES = Registry("signal source", "triaxcal.rig.sources.kinds", SourceKind, ("takes", "open"))


def kind_of(bus: str) -> SourceKind:
    """Kind of source that a value of --bus names; python-can's when no other does."""
    return next(kind for kind in SOURCES if kind.takes(bus))
