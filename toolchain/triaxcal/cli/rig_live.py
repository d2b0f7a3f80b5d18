"""The live part of `triaxcal rig`: screen, keys, the end of a session."""

from __future__ import annotations

import contextlib
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
from rich.console import Console, RenderableType
from rich.live import Live

from triaxcal.base.errors import RefusedError
from triaxcal.cli.keys import Keys
from triaxcal.cli.rig_hands import hands_of, made_safe
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.rig.bus.messages import messages_of
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.live import runner
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.records import recording, replay, store
from triaxcal.rig.records.rawlog import LogState
from triaxcal.rig.samples.undetected import undetected
from triaxcal.rig.screen.screen import (
    HELP,
    About,
    BusView,
    Faults,
    faults_page,
    help_page,
    plain_status,
    screen,
)
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.session.events import Agree, Command, Redo
from triaxcal.rig.session.forecast import duration
from triaxcal.rig.simulated.simulator import SimulatedRig
from triaxcal.rig.sources.canbus import Bus
from triaxcal.rig.sources.socketcan import SocketSource
from triaxcal.rig.sources.source import Source

_REFRESH_S = 0.25
_ABOVE_PAGE = 15
"""Lines of the screen that a page leaves to the rest."""
_ALARM_S = 10.0
_SCROLLS = {"n": 1, "b": -1}
_PAGES = {"?": "help", "h": "help", "f": "faults"}


class Stop(Exception):  # noqa: N818  not an error
    """The operator wants to stop."""


class Operator:
    """What the operator says by keys, and the page that is asked for.

    Attributes
    ----------
    page : str
        "", "help" or "faults".
    scrolled : int
        How often more units were asked for, less how often those before.
    """

    def __init__(self, keys: Keys) -> None:
        self._keys = keys
        self._of_checks = False
        self.page = ""
        self.scrolled = 0

    def words(self) -> list[Command]:
        """Commands since last asked."""
        words: list[Command] = []
        for key in self._keys.pressed():
            position = f"{'C' if self._of_checks else 'T'}P{key}"
            self._of_checks = key == "c"
            if key == "q":
                raise Stop
            if key == "y":
                words.append(Agree())
            elif key in _SCROLLS:
                self.scrolled += _SCROLLS[key]
            elif key in _PAGES:
                self.page = "" if self.page == _PAGES[key] else _PAGES[key]
            elif position in TEST_POSITIONS or position in CHECK_POSITIONS:
                words.append(Redo(position))
        return words


def guide(
    setup: Setup, source: Source, folder: Path, plain: bool, unattended: bool = False
) -> None:
    """Guide a session to its end and write the records."""
    start = time.monotonic()
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.closing(source))
        hands = hands_of(setup, source, unattended)
        taken = recording.Recording(setup, folder, source.name)
        stack.enter_context(contextlib.closing(taken))
        stack.enter_context(made_safe(hands))
        try:
            log = _guided(taken, source, hands, plain, start)
        except (Stop, KeyboardInterrupt):
            click.echo(f"stopped; go on with: triaxcal rig resume --unit {setup.folder}", err=True)
            sys.exit(1)
    _write(setup, taken, log)


def _guided(
    taken: recording.Recording,
    source: Source,
    hands: runner.Hands | None,
    plain: bool,
    start: float,
) -> LogState:
    """Guide a session to its end; the state of its log."""
    if taken.lock.left_by is not None:
        click.echo(f"taken over from {taken.lock.left_by.described}, which has ended")
    if taken.resumed:
        session = taken.engine.session
        session.last_event = (
            f"resumed in {time.monotonic() - start:.2f} s, {len(session.accepted)} accepted "
            "dwells kept"
        )
        click.echo(session.last_event)
    say_first(taken.engine.setup.rig)
    keys = Keys(not plain)
    operator = Operator(keys)
    with keys.listening():
        ticks = runner.live(taken, source, operator.words, hands)
        left_s = hands.left_s(taken.engine.session) if hands else None
        if left_s:
            click.echo(f"predicted: about {duration(left_s)}")
        if plain:
            _plainly(ticks, taken)
        else:
            _on_screen(ticks, taken, source, hands, operator)
    taken.log.flush(sync=True)
    return taken.log.state  # reads the log: while it is open


def say_first(rig: RigDescription) -> None:
    """Say what is wrong in the bus description, and what nothing on the bus would show."""
    for text in (*rig.warnings, *undetected(rig)):
        click.echo(f"note: {text}", err=True)


def _write(setup: Setup, taken: recording.Recording, log: LogState) -> None:
    """Records of the session; a resumed one is put together from its log."""
    session = taken.engine.session
    if taken.resumed:
        path = taken.folder / recording.LOG_FILE
        played = replay.replay(setup, path, taken.folder / recording.JOURNAL_FILE)
        if played.engine.session.accepted != session.accepted:
            raise RefusedError(
                str(path), "gives other dwells than the journal", remedy="report this session"
            )
        session, log = played.engine.session, played.log
    show_written(store.write_records(setup.folder, session, setup.rig, log))
    click.echo(f"next: make calib-header UNIT={setup.unit.name}")


def show_written(done: store.Written) -> None:
    """Say what was written, and what was kept of earlier records."""
    if done.kept:
        click.echo("earlier records kept: " + ", ".join(map(str, done.kept)))
    click.echo("written: " + ", ".join(map(str, done.files)))


def _plainly(ticks: Iterator[runner.Tick], taken: recording.Recording) -> None:
    before = ""
    for tick in ticks:
        for event in tick.events:
            if event.text != before:
                stamp = time.strftime("%H:%M:%S", time.gmtime(event.t_ns / 1e9))
                click.echo(f"{stamp} {event.kind}: {event.text}")
            before = event.text
        for note in tick.notes:
            click.echo(f"bus: {note}")
        for text in tick.done:
            click.echo(text)
    click.echo(plain_status(view(taken.engine.session)))


def _on_screen(
    ticks: Iterator[runner.Tick],
    taken: recording.Recording,
    source: Source,
    hands: runner.Hands | None,
    operator: Operator,
) -> None:
    alarms: deque[tuple[float, str]] = deque(maxlen=8)
    faults = Faults()
    shown = 0.0
    with Live(console=Console(), screen=True, auto_refresh=False) as picture:
        for tick in ticks:
            now = time.monotonic()
            said = [e.text for e in tick.events if e.kind in {"refused", "trouble", "left"}]
            alarms.extend((now, text) for text in (*said, *tick.notes))
            faults.add(time.strftime("%H:%M:%S"), (*said, *tick.notes))
            if now - shown < _REFRESH_S:
                continue
            shown = now
            while alarms and now - alarms[0][0] > _ALARM_S:
                alarms.popleft()
            shown_view = view(taken.engine.session)
            if hands is not None:
                shown_view = hands.shown(taken.engine.session, shown_view)
            picture.update(
                screen(
                    shown_view,
                    _bus_view(source, tick),
                    tuple(text for _, text in alarms),
                    _about(taken, shown_view.left_s),
                    page_of(operator.page, faults, picture.console),
                ),
                refresh=True,
            )


def _bus_view(source: Source, tick: runner.Tick) -> BusView:
    dropped = source.dropped if isinstance(source, SocketSource) else 0
    rates = source.rates
    load = rates.load(tick.bits_per_s, tick.fast_bits_per_s) if rates is not None else None
    return BusView(source.name, tick.frames_per_s, load, dropped)


def _about(taken: recording.Recording, left_s: float | None) -> About:
    unit = taken.engine.session.unit
    return About(unit.name, unit.serial, taken.folder.name, clock_of_end(time.time(), left_s))


def clock_of_end(now_s: float, left_s: float | None) -> str:
    """Clock time so many seconds later, with the day where it is another one."""
    if left_s is None:
        return "-"
    now, end = time.localtime(now_s), time.localtime(now_s + left_s)
    same_day = now[:3] == end[:3]
    return time.strftime("%H:%M" if same_day else "%a %H:%M", end)


def page_of(
    name: str, faults: Faults, console: Console, keys: Sequence[tuple[str, str]] = HELP
) -> RenderableType | None:
    """Page that the operator asked for; None for none."""
    if name == "faults":
        return faults_page(faults, max(3, console.size.height - _ABOVE_PAGE))
    return help_page(keys) if name == "help" else None


def simulate_on(
    bus: Bus, rig: SimulatedRig, plan: SessionPlan, seconds: float | None, hold: int
) -> None:
    """Send the simulated rig's frames at the pace of the clock."""
    positions = [p for step in plan.steps for p in step.positions]
    start = time.monotonic()
    try:
        while seconds is None or rig.seconds < seconds:
            if rig.seconds % hold == 0:
                rig.turn_to(positions[rig.seconds // hold % len(positions)])
            frames = rig.advance()
            first = int(frames.t_ns[0]) if len(frames) else 0
            base = start + rig.seconds - 1
            for t_ns, message in zip(frames.t_ns.tolist(), messages_of(frames), strict=True):
                wait = base + (t_ns - first) / 1e9 - time.monotonic()
                if wait > 0.001:
                    time.sleep(wait)
                bus.send(message)
            time.sleep(max(0.0, start + rig.seconds - time.monotonic()))
    except KeyboardInterrupt:
        click.echo("stopped", err=True)
    finally:
        bus.shutdown()
