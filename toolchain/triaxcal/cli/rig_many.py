"""`triaxcal rig run` of a plan that lists units: lines, screen, the end of the session."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import click
from rich.console import Console
from rich.live import Live

from triaxcal.base.errors import RefusedError
from triaxcal.cli.keys import Keys
from triaxcal.cli.rig_hands import made_safe
from triaxcal.cli.rig_live import Operator, Stop, clock_of_end, page_of, show_written
from triaxcal.cli.rig_options import BusChoice, refuse_other_kind
from triaxcal.rig.live.attendant import Attendant, attendant
from triaxcal.rig.live.simhands import simulated_attendant
from triaxcal.rig.many.group import Group
from triaxcal.rig.many.hands import ManyAttendant
from triaxcal.rig.many.recording import ManyRecording, log_file
from triaxcal.rig.many.replay import replay_bus
from triaxcal.rig.many.runner import ManyHands, ManyRobot, ManyTick, live_many
from triaxcal.rig.many.screen import HELP, Recent, group_line, many_screen
from triaxcal.rig.many.setup import ManySetup
from triaxcal.rig.many.simbench import SimulatedBench, simulated_bench
from triaxcal.rig.records import store
from triaxcal.rig.records.rawlog import LogState
from triaxcal.rig.samples.undetected import undetected
from triaxcal.rig.session.forecast import duration
from triaxcal.rig.session.session import Session
from triaxcal.rig.simulated.simulator import SimulatedRig
from triaxcal.rig.sources.canbus import VirtualSource
from triaxcal.rig.sources.gather import Gathered
from triaxcal.rig.sources.source import Source, Wanted, kind_of

_REFRESH_S = 0.25
_QUIET = {"found"}
"""Kinds of event of single units that say nothing new: the order is that of the group."""


@dataclass(frozen=True)
class _Opened:
    """Sources of a session, and the bench behind them where it is simulated."""

    sources: Gathered
    bench: SimulatedBench | None

    @property
    def clock(self) -> Callable[[], float]:
        """Seconds from any moment on."""
        bench = self.bench
        return time.monotonic if bench is None else lambda: float(bench.seconds)


def guide_many(
    setup: ManySetup, bus: BusChoice, folder: Path, plain: bool, unattended: bool
) -> None:
    """Guide a session of many units to its end and write the records of those that are done."""
    opened = _open(setup, bus)
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.closing(opened.sources))
        hands, own = _hands(setup, opened, unattended)
        taken = ManyRecording(setup, folder, follow=hands is None)
        stack.enter_context(contextlib.closing(taken))
        stack.enter_context(made_safe(own))
        try:
            _guided(taken, opened, hands, plain)
            logs = {name: here.log.state for name, here in taken.buses.items()}
        except (Stop, KeyboardInterrupt):
            plan = f"triaxcal rig resume --plan {setup.source}"
            click.echo(f"stopped; go on with: {plan}", err=True)
            sys.exit(1)
    _write(taken, logs)


def _open(setup: ManySetup, bus: BusChoice) -> _Opened:
    """Sources of the buses; those of the simulated bench where --bus is virtual."""
    kind = kind_of(bus.name) if bus.name else None
    if kind is not None and kind.simulated:
        bench = simulated_bench(setup, bus.faults, bus.seed)
        lanes = {name: VirtualSource(lane.advance, name) for name, lane in bench.lanes.items()}
        return _Opened(Gathered(lanes, in_step=True), bench)
    if bus.faults:
        raise RefusedError("--fault", "given for a real bus", expected="--bus virtual")
    sources: dict[str, Source] = {}
    try:
        for name in setup.buses:
            here = [place.setup for place in setup.places if place.bus == name]
            for one in here:
                refuse_other_kind(one, kind_of(name))
            fd = any(one.rig.fd for one in here)
            wanted = Wanted(name, fd, _no_rig, here[0].rig.lines)
            sources[name] = kind_of(name).open(wanted)
    except BaseException:
        for source in sources.values():
            source.close()
        raise
    return _Opened(Gathered(sources), None)


def _no_rig() -> SimulatedRig:
    raise RefusedError(
        "[unit.UNIT] bus", 'found "virtual"', expected="a bus", remedy="give --bus virtual"
    )


def _hands(
    setup: ManySetup, opened: _Opened, unattended: bool
) -> tuple[ManyHands | None, Attendant | None]:
    """Hands of a session, and the attendant that has the instruments."""
    bench, plan = opened.bench, setup.plan
    if not unattended:
        return (ManyRobot(bench) if bench is not None else None), None
    if bench is not None and plan.equipment.positioner_by.by_hand:
        own = simulated_attendant(plan, bench)
    else:
        own = attendant(plan, opened.clock, at_once=bench is not None)
    return ManyAttendant(own, opened.clock), own


def _guided(taken: ManyRecording, opened: _Opened, hands: ManyHands | None, plain: bool) -> None:
    if taken.lock.left_by is not None:
        click.echo(f"taken over from {taken.lock.left_by.described}, which has ended")
    group = taken.group
    if taken.resumed:
        kept = sum(len(m.session.accepted) for m in group.members)
        click.echo(f"resumed, {kept} accepted dwells kept")
    for text in _said_once(taken.setup):
        click.echo(f"note: {text}", err=True)
    keys = Keys(not plain)
    operator = Operator(keys)
    with keys.listening():
        ticks = live_many(taken, opened.sources, operator.words, hands, opened.clock)
        left_s = hands.left_s(group) if hands else None
        if left_s:
            click.echo(f"predicted: about {duration(left_s)}")
        if plain:
            _plainly(ticks, group)
        else:
            _on_screen(ticks, taken, hands, operator)
    taken.flush(sync=True)


def _said_once(setup: ManySetup) -> list[str]:
    """Warnings of the rig descriptions, each once."""
    rigs = [place.setup.rig for place in setup.places]
    return list(dict.fromkeys(t for rig in rigs for t in (*rig.warnings, *undetected(rig))))


def _plainly(ticks: Iterator[ManyTick], group: Group) -> None:
    before: dict[str, str] = {}
    order = ""
    for tick in ticks:
        stamp = time.strftime("%H:%M:%S", time.gmtime(tick.t_ns / 1e9))
        for member, event in tick.told:
            if event.kind not in _QUIET and before.get(member.name) != event.text:
                click.echo(f"{stamp} {member.name} {event.kind}: {event.text}")
            before[member.name] = event.text
        for member in tick.asides:
            click.echo(f"{stamp} {member.name} set aside: {member.aside}")
        for note in tick.notes:
            click.echo(f"bus: {note}")
        for text in tick.done:
            click.echo(text)
        if (new := group_line(group)) != order:
            order = new
            click.echo(f"{stamp} all: {order}")


def _on_screen(
    ticks: Iterator[ManyTick], taken: ManyRecording, hands: ManyHands | None, operator: Operator
) -> None:
    recent, shown = Recent(), 0.0
    with Live(console=Console(), screen=True, auto_refresh=False) as picture:
        for tick in ticks:
            now = time.monotonic()
            recent.add(now, tick)
            if now - shown < _REFRESH_S:
                continue
            shown = now
            left_s = hands.left_s(taken.group) if hands else None
            ends = clock_of_end(time.time(), left_s)
            page = page_of(operator.page, recent.faults, picture.console, HELP)
            alarm, name = recent.alarm(now), taken.folder.name
            view = many_screen(
                taken.group, name, ends, alarm, page=page, scrolled=operator.scrolled
            )
            picture.update(view, refresh=True)


def _write(taken: ManyRecording, logs: dict[str, LogState]) -> None:
    """Records of the units that are done; what became of the others."""
    sessions = {m.name: m.session for m in taken.group.members}
    if taken.resumed:
        sessions, logs = _again(taken)
    done = [m for m in taken.group.members if not m.aside]
    for member in done:
        setup, bus = member.place.setup, member.place.bus
        number = taken.setup.buses.index(bus) + 1
        log = {**logs[bus], "file": str(taken.folder / log_file(number))}
        show_written(store.write_records(setup.folder, sessions[member.name], setup.rig, log))
    aside = [m for m in taken.group.members if m.aside]
    for member in aside:
        click.echo(f"{member.name}: set aside, no records written: {member.aside}", err=True)
    if done:
        click.echo("next: triaxcal batch " + " ".join(str(m.place.setup.folder) for m in done))
    if aside:
        raise RefusedError(
            str(taken.folder),
            f"{len(aside)} of {len(taken.group.members)} units set aside: "
            + ", ".join(m.name for m in aside),
            remedy="measure each of them again with `triaxcal rig run --plan ... --unit NAME`",
        )


def _again(taken: ManyRecording) -> tuple[dict[str, Session], dict[str, LogState]]:
    """Sessions of a resumed recording, put together from its logs, and the state of each log."""
    sessions: dict[str, Session] = {}
    logs: dict[str, LogState] = {}
    for bus in taken.buses:
        names = [m.name for m in taken.group.members if m.place.bus == bus and not m.aside]
        again, logs[bus] = replay_bus(taken.setup, taken.folder, bus, names)
        sessions |= again
    return sessions, logs
