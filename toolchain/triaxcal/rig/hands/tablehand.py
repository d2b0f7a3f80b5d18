"""The positioner of an unattended run: told, asked, checked against the readings."""

from __future__ import annotations

from collections.abc import Callable

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.equipment import Positioner
from triaxcal.rig.hands.link import Link, Numbers
from triaxcal.rig.hands.orientation import described

_NAME = "positioner"
_SEEN_S = 10.0
"""The readings show the position so long after the arrival: their blocks are of one second."""


class TableHand:
    """Turns the positioner; finds out when it is not where it was told to be.

    Attributes
    ----------
    told : str or None
        Position that it was told last.
    arrived_s : float or None
        When it arrived there.
    """

    def __init__(
        self,
        positioner: Positioner,
        link: Link,
        readable: bool,
        attempts: int,
        say: Callable[[str], None],
    ) -> None:
        self.told: str | None = None
        self.arrived_s: float | None = None
        self._positioner = positioner
        self._link = link
        self._readable = readable
        self._attempts = attempts
        self._say = say
        self._path: list[str] = []
        self._since = self._next = 0.0
        self._failed = 0

    def tend(self, now_s: float, wanted: str, away: str, seen: str | None) -> None:
        """Bring it into a position; one look at it.

        Parameters
        ----------
        away : str
            Another position, to come from when it is not in the one that is wanted.
        seen : str or None
            Position that the readings show.

        Raises
        ------
        RefusedError
            When it does not answer, or is not where it was told to be after all attempts.
        """
        answer = self._link.collect(now_s)
        if self._link.busy:
            return
        if self._path[-1:] != [wanted]:
            self._path, self._failed = [wanted], 0
        if self.told != self._path[0]:
            self._turn(now_s, self._path[0])
        elif self.arrived_s is None:
            self._arrive(now_s, self.told, away, answer)
        elif len(self._path) > 1:
            if seen == self.told or now_s - self.arrived_s > _SEEN_S:
                self._path.pop(0)
        elif seen != self.told and now_s - self.arrived_s > _SEEN_S:
            shown = f"the readings show {described(seen)}" if seen else "the readings show none"
            self._fail(f"told to go to {described(self.told)}, {shown}", away)

    def make_safe(self) -> str:
        """Give the last order, and say how it went."""
        home = self._positioner.home
        if home == "stay":
            return f"{_NAME}: left as it is"
        order = self._positioner.order(home)
        failed = self._link.last_order(lambda instrument: instrument.write(order))
        if failed:
            return f"{_NAME}: NOT sent home to {home}, do it by hand: {failed}"
        return f"{_NAME}: sent home to {home}"

    def _turn(self, now_s: float, position: str) -> None:
        order = self._positioner.order(position)
        self.told, self.arrived_s, self._since = position, None, now_s
        self._next = now_s + self._positioner.poll_s
        self._link.ask(lambda instrument: instrument.write(order), now_s)

    def _arrive(self, now_s: float, told: str, away: str, answer: Numbers | None) -> None:
        if not self._readable:
            if now_s - self._since >= self._positioner.turn_s:
                self.arrived_s = now_s
            return
        if answer and self._positioner.is_at(told, tuple(answer)):
            self.arrived_s = now_s
        elif answer and now_s - self._since > self._positioner.turn_max_s:
            at = ", ".join(f"{value:g}" for value in answer)
            late = f"not there after {self._positioner.turn_max_s:g} s"
            self._fail(f"told to go to {described(told)}, {late}: it answers {at}", away)
        elif now_s >= self._next:
            self._next = now_s + self._positioner.poll_s
            self._link.ask(lambda instrument: instrument.read(), now_s)

    def _fail(self, text: str, away: str) -> None:
        self._failed += 1
        if self._failed >= self._attempts:
            raise RefusedError(
                _NAME,
                f"{text} (tried {self._failed} times)",
                remedy="check the positioner, its `angles` in the plan and volts_per_g",
            )
        self._say(f"{_NAME}: {text}; turned away and back")
        self._path.insert(0, away)
