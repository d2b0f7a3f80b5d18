"""The operator's place in an unattended run of many units."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from triaxcal.base.errors import RefusedError
from triaxcal.rig.live.attendant import Attendant
from triaxcal.rig.many.group import Group
from triaxcal.rig.many.member import Member, Told
from triaxcal.rig.session.forecast import duration


class ManyAttendant:
    """Tells chamber and positioner what a group wants.

    Parameters
    ----------
    attendant : Attendant
        Has the instruments.
    clock : callable
        Its clock.
    """

    def __init__(self, attendant: Attendant, clock: Callable[[], float]) -> None:
        self._attendant = attendant
        self._clock = clock

    def act(self, group: Group, told: Sequence[Told]) -> None:
        """Do what the group wants.

        Raises
        ------
        RefusedError
            When the run cannot go on.
        """
        if group.done:
            return
        now_s = self._clock()
        if group.stop:
            raise RefusedError(
                "unattended run",
                group.stop,
                remedy="what was accepted is kept: `triaxcal rig resume`",
            )
        # The pace of all is that of the one that the others wait for.
        slowest = _slowest(group)
        mine = [event for member, event in told if member is slowest]
        if self._attendant.forecast.see(now_s, slowest.session, mine):
            self._attendant.say(f"left: about {duration(self.left_s(group))}")
        if not any(m.heard_s is not None for m in group.active):
            return
        rests = any(event.kind == "equilibrium" for _, event in told)
        self._attendant.heat(now_s, group.target_degc, group.temp_degc, rests)
        wanted = group.position
        others = [p for step in group.plan.steps for p in step.positions if p != wanted]
        self._attendant.turn(now_s, wanted, others[0], group.seen)

    def left_s(self, group: Group) -> float:
        """Predicted seconds to the end."""
        if group.done:
            return 0.0
        return self._attendant.forecast.left_s(self._clock(), _slowest(group).session)

    def notes(self) -> list[str]:
        """What was done since last asked, one line each."""
        return self._attendant.notes()

    def make_safe(self) -> list[str]:
        """Bring chamber and positioner to where they stay; what was done, one line each."""
        return self._attendant.make_safe()


def _slowest(group: Group) -> Member:
    """Unit of the group that has most to be measured."""
    return max(group.behind, key=lambda m: len(m.session.pending))
