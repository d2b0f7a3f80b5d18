"""A session of many units on the disk: one folder, one journal, a log for each bus."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.many.group import Group
from triaxcal.rig.many.member import Member
from triaxcal.rig.many.setup import ManySetup
from triaxcal.rig.records.journal import Journal, Record, disk_refusal, read_journal
from triaxcal.rig.records.lock import Lock
from triaxcal.rig.records.rawlog import RawLog
from triaxcal.rig.records.recording import (
    FORMAT,
    JOURNAL_FILE,
    LOCK_FILE,
    Troubles,
    command_record,
    durable_events,
    event_record,
    frames_ns,
    header,
    known_log,
    refuse_other_session,
    whole_microseconds,
)
from triaxcal.rig.samples.split import Splitter
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.events import Command, Event

_DECIDE_NS = 250_000_000
"""Frames wait so long for the decoders. Decisions do not depend on how frames are cut."""


def log_file(number: int) -> str:
    """Name of the log of a bus, by its place among them from 1."""
    return f"frames-{number}.log"


def of_unit(records: Sequence[Record], name: str) -> list[Record]:
    """Records about one unit."""
    return [record for record in records if record.get("unit") == name]


class BusLog:
    """One bus: its log, its units, the frames that wait."""

    def __init__(self, log: RawLog, members: Sequence[Member]) -> None:
        self.log = log
        self.members = tuple(members)
        self.waiting: list[Frames] = []
        self._splitter = Splitter([m.place.setup.rig for m in members])

    def split(self) -> list[tuple[Member, Frames]]:
        """The frames that wait, by unit."""
        frames = concatenate(self.waiting)
        self.waiting = []
        parts = self._splitter.split(frames)
        return list(zip(self.members, parts, strict=True))


class ManyRecording:
    """A live session of many units: evidence first, then decisions, then acknowledgements.

    Whatever `feed` returns is on the disk already.

    Attributes
    ----------
    resumed : bool
        It goes on with a session that was there.
    """

    def __init__(self, setup: ManySetup, folder: Path, follow: bool = True) -> None:
        """Start a session in a folder, or go on with the one that is there.

        Raises
        ------
        RefusedError
            When another process has the session, the disk refuses, the journal is damaged, or it
            is about other units or another plan.
        """
        self.setup = setup
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise disk_refusal(folder, error) from error
        self.lock = Lock(folder / LOCK_FILE, "a session")
        try:
            self._open(follow)
        except BaseException:
            self.lock.close()
            raise

    def _open(self, follow: bool) -> None:
        setup, path = self.setup, self.folder / JOURNAL_FILE
        records = read_journal(path).records if path.exists() else ()
        self.resumed = bool(records)
        if records:
            refuse_other_units(path, records[0], setup)
        self.journal = Journal(path)
        asides = {r["unit"]: r["text"] for r in records if r["kind"] == "aside"}
        members = []
        for place in setup.places:
            history = durable_events(of_unit(records, place.name))
            engine = Engine(place.setup, place.bus, history)
            members.append(Member(place, engine, asides.get(place.name, "")))
        self.buses: dict[str, BusLog] = {}
        for number, bus in enumerate(setup.buses, 1):
            here = [m for m in members if m.place.bus == bus]
            seen = [r for r in records if r.get("bus") == bus]
            log = RawLog(self.folder / log_file(number), bus, known_log(seen))
            self.buses[bus] = BusLog(log, here)
        self.group = Group(setup.plan, members, follow)
        self._troubles = {member.name: Troubles() for member in self.group.members}
        if not records:
            self.journal.append(header_of(setup))
            return
        for member in members:
            self._log(member).flush(sync=True)
            durable = len(member.session.durable)
            self._append(member, {"kind": "resume", "durable": durable}, hashed=False)

    def feed(self, bus: str, frames: Frames) -> list[tuple[Member, Event]]:
        """Record frames of a bus and decide.

        Raises
        ------
        RefusedError
            When the disk refuses, or a unit is another one at the start.
        """
        here = self.buses[bus]
        frames = whole_microseconds(frames)
        here.log.append(frames)
        if len(frames):
            here.waiting.append(frames)
        if not here.waiting or 0 <= frames_ns(here.waiting) < _DECIDE_NS:
            return []
        return self._decide(here)

    def command(self, command: Command, t_ns: int) -> list[tuple[Member, Event]]:
        """Record a word of the operator, for every unit, and decide.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        told = [each for here in self.buses.values() for each in self._decide(here)]
        for member in self.group.members:
            if member.aside:
                continue
            self._log(member).flush(sync=True)
            self._append(member, command_record(command, t_ns))
            told += self._acknowledge(member, member.engine.command(command, t_ns))
        return told

    def put_aside(self, member: Member, reason: str, t_ns: int) -> None:
        """Record that a unit takes no further part.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        member.aside = reason
        self._log(member).flush(sync=True)
        self._append(member, {"kind": "aside", "text": reason, "t_ns": t_ns})

    def note(self, text: str, t_ns: int) -> None:
        """Record what was done to chamber and positioner; it decides nothing.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        self.journal.append({"kind": "note", "text": text, "t_ns": t_ns})

    def flush(self, sync: bool = False) -> None:
        """Give the logs to the system; with `sync`, wait until the disk has them.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        for here in self.buses.values():
            here.log.flush(sync=sync)

    def close(self) -> None:
        """Close logs and journal, and let go of the folder.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        try:
            for here in self.buses.values():
                here.log.close()
        finally:
            self.journal.close()
            self.lock.close()

    def _decide(self, here: BusLog) -> list[tuple[Member, Event]]:
        told: list[tuple[Member, Event]] = []
        if not here.waiting:
            return told
        for member, frames in here.split():
            if member.aside or not len(frames):
                continue
            try:
                events = member.engine.feed(frames)
            except RefusedError as error:
                if member.session.reference is None:
                    raise
                t_ns = int(frames.t_ns[-1])
                self.put_aside(member, str(error), t_ns)
                continue
            told += self._acknowledge(member, events)
        return told

    def _acknowledge(self, member: Member, events: list[Event]) -> list[tuple[Member, Event]]:
        for event in events:
            if self._troubles[member.name].repeated(event):
                continue
            self._log(member).flush(sync=True)
            self._append(member, {"kind": "event", "event": event_record(event)})
        return [(member, event) for event in events]

    def _append(self, member: Member, record: Record, hashed: bool = True) -> None:
        log = self._log(member)
        place = {"bus": member.place.bus, "log": log.state if hashed else log.place}
        self.journal.append({**record, "unit": member.name, **place})

    def _log(self, member: Member) -> RawLog:
        return self.buses[member.place.bus].log


def header_of(setup: ManySetup) -> Record:
    """First record of a journal: the units, and what each of them is about."""
    units = [
        {**header(p.setup), "name": p.name, "bus": p.bus, "log": _log_of(setup, p.bus)}
        for p in setup.places
    ]
    return {"kind": "session", "format": FORMAT, "units": units}


def _log_of(setup: ManySetup, bus: str) -> str:
    return log_file(setup.buses.index(bus) + 1)


def refuse_other_units(path: Path, record: Record, setup: ManySetup) -> None:
    """Refuse a journal that is not of these units and this plan.

    Raises
    ------
    RefusedError
        Naming what differs.
    """
    units = {unit["name"]: unit for unit in record.get("units", ())}
    places = {place.name: place for place in setup.places}
    if set(units) != set(places):
        raise RefusedError(
            str(path),
            "of the units " + (", ".join(sorted(units)) or "none"),
            expected=", ".join(sorted(places)) + f", as {setup.source}",
            remedy="use the plan that the session was started with",
        )
    for name, place in places.items():
        refuse_other_session(path, units[name], place.setup)
        if units[name]["bus"] != place.bus:
            raise RefusedError(
                f"{path}, {name}", f"on {units[name]['bus']}", expected=f"{place.bus}"
            )
