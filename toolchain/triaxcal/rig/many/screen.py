"""What the operator of many units sees: one order in big letters, and a line for each unit."""

from __future__ import annotations

import time
from collections import deque

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.console import Group as Lines
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from triaxcal.rig.hands.orientation import described
from triaxcal.rig.many.group import Group
from triaxcal.rig.many.member import Member
from triaxcal.rig.many.runner import ManyTick
from triaxcal.rig.screen.screen import ALARM, COLOURS, BigText, Faults, Fitted
from triaxcal.rig.screen.view import up_letters
from triaxcal.rig.session.phases import Turning

_ALARM_S = 10.0
_SAID = {"refused", "left"}
_STYLES = {"reference": "reference", "temperature": "temperature", "turn": "turn",
           "dwell": "average", "done": "done"}  # fmt: skip
_AROUND = 12
"""Lines of the screen beside the units, with small letters."""
_AROUND_TALL = 17
_TALL = 30
_KEYS = " 1-6 TP again  c 1-6 CP again  n, b more units  f faults  ? help  q stop"
HELP = (
    ("1 to 6", "measure TP1 to TP6 of this temperature again, of every unit"),
    ("c, 1 to 6", "the same of the check positions CP1 to CP6"),
    ("n, b", "more units in the order of the plan, and back; first those with a fault"),
    ("f", "list what was refused and what went wrong; f again goes back"),
    ("?", "this page; ? again goes back"),
    ("q", "stop; `triaxcal rig resume` goes on, accepted dwells are kept"),
)
"""Keys of the operator of many units, and what they do."""


class Recent:
    """What went wrong.

    Attributes
    ----------
    faults : Faults
        All of it, for the page of faults.
    """

    def __init__(self) -> None:
        self.faults = Faults()
        self._alarms: deque[tuple[float, str]] = deque(maxlen=32)

    def add(self, now_s: float, tick: ManyTick) -> None:
        """Take what a pass of the loop brought."""
        said = [f"{m.name} {e.text}" for m, e in tick.told if e.kind in _SAID]
        said += [f"{m.name} set aside: {m.aside}" for m in tick.asides]
        texts = (*said, *tick.notes)
        self._alarms.extend((now_s, text) for text in texts)
        self.faults.add(time.strftime("%H:%M:%S"), texts)

    def alarm(self, now_s: float) -> str:
        """The last one of the last seconds; "" when there is none."""
        while self._alarms and now_s - self._alarms[0][0] > _ALARM_S:
            self._alarms.popleft()
        more = f" (and {len(self._alarms) - 1} more)" if len(self._alarms) > 1 else ""
        return self._alarms[-1][1] + more if self._alarms else ""


def many_screen(
    group: Group,
    session: str,
    ends: str,
    alarm: str,
    *,
    page: RenderableType | None = None,
    scrolled: int = 0,
) -> Fitted:
    """Everything the operator sees, for 80 columns and 24 lines or more.

    Parameters
    ----------
    session, ends : str
        Name of the session's folder; clock time of its end.
    alarm : str
        What went wrong; "" for nothing.
    page : renderable, optional
        `help_page` or `faults_page`, in place of the units.
    scrolled : int
        How often the operator asked for more units, less how often for those before.
    """
    style = ALARM if alarm else COLOURS[_STYLES[group.stage]]
    done = sum(len(m.session.accepted) for m in group.members)
    whole = sum(len(step.positions) for step in group.plan.steps) * len(group.members)
    title = f" {len(group.members)} units   session {session}   ends {ends}   {done}/{whole}"
    return Fitted(
        (
            (4, Text(title, style="bold", no_wrap=True, overflow="ellipsis")),
            (2, Padding(BigText(_order(group)), (1, 2, 0, 2), style=style)),
            (0, Padding(Text(group_line(group), "bold", justify="center"), (0, 2), style=style)),
            (1, Text(f" ALARM: {alarm}" if alarm else " ", "bold")),
            (3, Text(_step(group), "bold")),
            (2, _Units(group, scrolled) if page is None else page),
            (8, Text(_KEYS, "dim", no_wrap=True, overflow="ellipsis")),
        )
    )


def group_line(group: Group) -> str:
    """What all units wait for, in one line."""
    stage = group.stage
    if stage == "done":
        aside = sum(bool(m.aside) for m in group.members)
        return f"DONE - {len(group.members) - aside} units measured, {aside} set aside"
    position, target = described(group.position), group.target_degc
    return {
        "reference": f"LEARNING THE NOISE in {position} - do not touch",
        "temperature": f"WAIT FOR {target:g} degC - in {position}, do not touch",
        "turn": f"TURN TO {position}" if group.follow else f"THE TABLE TURNS TO {position}",
        "dwell": f"MEASURING {position} - do not touch",
    }[stage]


def state_of(group: Group, member: Member) -> tuple[str, str]:
    """What a unit does, and how far it is."""
    session = member.session
    if member.aside:
        return "SET ASIDE", ""
    if session.done:
        return "done", ""
    if session.previous is None:
        return "NO READINGS", ""
    if session.step > group.step:
        return "ahead", ""
    if isinstance(session.phase, Turning) and not member.takes(group.position):
        waits = "must leave" if group.position in session.pending else "accepted"
        return waits, ""
    stage, done, whole = session.phase.progress(session)
    return stage, f"{done}/{whole} s" if whole else ""


def _order(group: Group) -> str:
    """What to do, in the letters of `bigtext`."""
    stage = group.stage
    if stage == "done":
        return "DONE"
    if not group.follow and stage == "turn":
        return "HANDS OFF"
    if group.follow and group.seen != group.position:
        return f"TURN TO {up_letters(group.position)}"
    if stage == "temperature":
        return f"WAIT FOR {group.target_degc:g}"
    return f"HANDS OFF {max((_left_s(m, group) for m in group.behind), default=0)}"


def _left_s(member: Member, group: Group) -> int:
    """Seconds until the unit has learned its noise, or its dwell has ended."""
    session = member.session
    stage, done, whole = session.phase.progress(session)
    if stage == "reference":
        return whole - done
    return session.dwell_s[2] - len(session.rest) if member.takes(group.position) else 0


def _step(group: Group) -> str:
    if group.done:
        return " done"
    steps = len(group.plan.steps)
    temps = [m.session.temp_degc for m in group.active if m.session.temp_degc is not None]
    shown = f"units at {min(temps):.2f} to {max(temps):.2f} degC" if temps else "no temperature"
    return f" Step {group.step + 1}/{steps}, {group.target_degc:g} degC; {shown}"


class _Units:
    """A line for each unit; where there is no room, those that need attention first.

    Scrolled, they are those of the plan, so many at a time as there is room for.
    """

    def __init__(self, group: Group, scrolled: int) -> None:
        self._group, self._scrolled = group, scrolled

    def __rich_console__(self, console: Console, _: ConsoleOptions) -> RenderResult:
        """Table of the units."""
        group, height = self._group, console.size.height
        room = max(1, height - (_AROUND_TALL if height >= _TALL else _AROUND))
        members = list(group.members)
        hidden: list[Member] = []
        if len(members) > room:
            at_once = max(room - 1, 1)
            page = self._scrolled % (1 - -len(members) // at_once)
            first = at_once * (page - 1) if page else 0
            order = members if page else sorted(members, key=_calm)
            kept = {m.name for m in order[first : first + at_once]}
            hidden = [m for m in members if m.name not in kept]
            members = [m for m in members if m.name in kept]
        table = Table(box=None, padding=(0, 1), expand=True)
        for title in ("unit", "state", "", "seen"):
            table.add_column(title, no_wrap=True)
        for title in ("degC", "done", "lost"):
            table.add_column(title, no_wrap=True, justify="right")
        table.add_column("last", no_wrap=True, overflow="ellipsis", ratio=1)
        for member in members:
            table.add_row(*_row(group, member), style="bold reverse" if member.aside else "")
        yield Lines(table, *([_summary(group, hidden)] if hidden else []))


def _calm(member: Member) -> tuple[bool, bool, bool]:
    """Sorts what needs attention before what does not."""
    failed = bool(member.failed) or member.session.unrest is not None
    return not member.aside, not failed, member.session.done


def _row(group: Group, member: Member) -> tuple[str, ...]:
    session = member.session
    state, progress = state_of(group, member)
    temp = f"{session.temp_degc:.2f}" if session.temp_degc is not None else "-"
    last = member.aside or member.last
    return (
        member.name, state, progress, session.seen or "-", temp, f"{len(session.accepted)}",
        f"{session.lost}", last,
    )  # fmt: skip


def _summary(group: Group, hidden: list[Member]) -> Text:
    """Units that there is no room for, counted by what they do."""
    counts: dict[str, int] = {}
    for member in hidden:
        state, _ = state_of(group, member)
        counts[state] = counts.get(state, 0) + 1
    said = ", ".join(f"{count} {state}" for state, count in counts.items())
    return Text(f" and {len(hidden)} more: {said}", "dim", no_wrap=True, overflow="ellipsis")
