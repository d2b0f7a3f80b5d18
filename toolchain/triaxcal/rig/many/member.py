"""One unit of a session of many."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from triaxcal.rig.hands.orientation import described
from triaxcal.rig.many.setup import Place
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.events import Event
from triaxcal.rig.session.session import Session


@dataclass
class Member:
    """One unit of a session of many.

    Attributes
    ----------
    aside : str
        Why it takes no further part; "" while it does.
    last : str
        What was refused last.
    heard_s, temp_s : float or None
        When readings and temperatures came last.
    failed : Counter
        Failures so far, by step and what failed: "visit" those in a row, "temperature", a position
        those that were superseded.
    """

    place: Place
    engine: Engine
    aside: str = ""
    last: str = ""
    heard_s: float | None = None
    temp_s: float | None = None
    failed: Counter[tuple[int, str]] = field(default_factory=Counter)
    index: int | None = None

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.place.name

    @property
    def session(self) -> Session:
        """Session of the unit."""
        return self.engine.session

    @property
    def active(self) -> bool:
        """Still to be measured."""
        return not self.aside and not self.session.done

    def takes(self, position: str) -> bool:
        """Whether it can be measured in a position that is wanted of it."""
        session = self.session
        left = session.reseat is not None and session.reseat.position == position
        return position in session.pending and not left

    @property
    def unrest(self) -> str:
        """Why it is not at rest, to be added to a text; "" when it is."""
        unrest = self.session.unrest
        return f": {unrest}" if unrest else ""

    def why_not(self, position: str) -> str:
        """Why it has not been accepted in a position, where nothing was refused."""
        seen = self.session.seen
        if seen != position:
            shown = f"the readings show {described(seen)}" if seen else "no position"
            return f"not in it: {shown}"
        return f"not at rest in time{self.unrest}"


Told = tuple[Member, Event]
Aside = tuple[Member, str]
