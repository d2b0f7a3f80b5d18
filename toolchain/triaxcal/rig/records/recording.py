"""A session on the disk: its folder, its evidence and journal, live and read again."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.logs.candump import NS_PER_US
from triaxcal.rig.records.journal import Journal, Record, disk_refusal, read_journal
from triaxcal.rig.records.lock import Lock
from triaxcal.rig.records.rawlog import LogState, RawLog
from triaxcal.rig.samples.undetected import undetected
from triaxcal.rig.session.engine import Engine, Setup
from triaxcal.rig.session.events import DURABLE, AcceptedDwell, Command, Event
from triaxcal.rig.session.reasons import Reason
from triaxcal.rig.session.stillness import Reference

FORMAT = 1
LOG_FILE = "frames.log"
JOURNAL_FILE = "session.journal"
LOCK_FILE = "session.lock"
_MAY_DIFFER = frozenset({"triaxcal", "plan", "unit", "rig", "undetected"})
_DECIDE_NS = 80_000_000
"""Frames wait so long for the decoder, which costs the same for ten as for a hundred; they are in
the log meanwhile. Decisions do not depend on how frames are cut."""
_NUMBERED = re.compile(r"[0-9]{3,}")


class Recording:
    """A live session: evidence first, then the decision, then the acknowledgement.

    Whatever `feed` returns is on the disk already.
    """

    def __init__(self, setup: Setup, folder: Path, channel: str) -> None:
        """Start a session in a folder, or go on with the one that is there.

        Raises
        ------
        RefusedError
            When another process has the session, the disk refuses, the journal is damaged, or it
            is about another unit, plan or DBC.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise disk_refusal(folder, error) from error
        self.lock = Lock(folder / LOCK_FILE, "a session")
        try:
            self._open(setup, folder, channel)
        except BaseException:
            self.lock.close()
            raise

    def _open(self, setup: Setup, folder: Path, channel: str) -> None:
        journal = folder / JOURNAL_FILE
        records = read_journal(journal).records if journal.exists() else ()
        self.folder = folder
        self.journal = Journal(journal)
        self.log = RawLog(folder / LOG_FILE, channel, known_log(records))
        history: tuple[Event, ...] = ()
        self.resumed = bool(records)
        if records:
            refuse_other_session(journal, records[0], setup)
            history = durable_events(records)
            self.log.flush(sync=True)
            log = self.log.place  # its hash would take seconds of a long session's log
            self.journal.append({"kind": "resume", "durable": len(history), "log": log})
        else:
            self.journal.append({**header(setup), "channel": channel})
        self.engine = Engine(setup, channel, history)
        self._troubles = Troubles()
        self._waiting: list[Frames] = []

    def feed(self, frames: Frames) -> list[Event]:
        """Record frames and decide.

        Raises
        ------
        RefusedError
            When the disk refuses, or the rig is not the unit's.
        """
        frames = whole_microseconds(frames)
        self.log.append(frames)
        if len(frames):
            self._waiting.append(frames)
        if not self._waiting or 0 <= frames_ns(self._waiting) < _DECIDE_NS:
            return []
        return self._decide()

    def command(self, command: Command, t_ns: int) -> list[Event]:
        """Record a word of the operator and decide.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        events = self._decide()
        self.log.flush(sync=True)
        self.journal.append({**command_record(command, t_ns), **self._place()})
        return [*events, *self._acknowledge(self.engine.command(command, t_ns))]

    def note(self, text: str, t_ns: int) -> None:
        """Record what was done to chamber and positioner; it decides nothing.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        self.journal.append({"kind": "note", "text": text, "t_ns": t_ns})

    def close(self) -> None:
        """Close log and journal, and let go of the folder.

        Raises
        ------
        RefusedError
            When the disk refuses.
        """
        try:
            self.log.close()
        finally:
            self.journal.close()
            self.lock.close()

    def _decide(self) -> list[Event]:
        frames = concatenate(self._waiting)
        self._waiting = []
        return self._acknowledge(self.engine.feed(frames))

    def _acknowledge(self, events: list[Event]) -> list[Event]:
        for event in events:
            if self._troubles.repeated(event):
                continue
            # A journal that knows more of the log than the disk has would be no witness.
            self.log.flush(sync=True)
            self.journal.append({"kind": "event", "event": event_record(event), **self._place()})
        return events

    def _place(self) -> dict[str, Any]:
        return {"log": self.log.state}


class Troubles:
    """Of one unit: the same trouble every second would bury the rest of a journal."""

    def __init__(self) -> None:
        self._last: tuple[Reason, ...] = ()

    def repeated(self, event: Event) -> bool:
        """Whether an event is the trouble of the one before it."""
        trouble = event.reasons if event.kind == "trouble" else ()
        before, self._last = self._last, trouble
        return bool(trouble) and trouble == before


def command_record(command: Command, t_ns: int) -> Record:
    """Record of a word of the operator, without its place."""
    said = {"name": type(command).__name__, **asdict(command), "t_ns": t_ns}
    return {"kind": "command", "command": said}


def frames_ns(parts: list[Frames]) -> int:
    """Time from the first frame of the first part to the last of the last.

    Negative where the computer's clock was set back in between.
    """
    return int(parts[-1].t_ns[-1]) - int(parts[0].t_ns[0])


def whole_microseconds(frames: Frames) -> Frames:
    """Frames with the times that the log keeps: live and replay must see the same."""
    return replace(frames, t_ns=frames.t_ns // NS_PER_US * NS_PER_US)


def header(setup: Setup) -> dict[str, Any]:
    """First record of a journal: what the session is about."""
    return {
        "kind": "session",
        "format": FORMAT,
        "triaxcal": __version__,
        "unit": setup.unit.name,
        "serial": setup.unit.serial,
        "plan": setup.plan.source,
        "plan_sha256": setup.plan.sha256,
        "dbc_sha256": setup.rig.bus_sha256,
        "rig": setup.rig.name,
        "rig_sha256": setup.rig.sha256,
        "undetected": list(undetected(setup.rig)),
    }


def refuse_other_session(path: Path, record: Record, setup: Setup) -> None:
    """Refuse a journal that is not of this unit, plan and DBC.

    Raises
    ------
    RefusedError
        Naming what differs.
    """
    for key, value in header(setup).items():
        # A journal of before the rig descriptions has no word of them.
        if key not in _MAY_DIFFER and record.get(key, value) != value:
            raise RefusedError(
                f"{path}, {key}",
                f"found {record.get(key)}",
                expected=f"{value}",
                remedy="use the unit, plan and rig description that the session was started with",
            )


def durable_events(records: Iterable[Record]) -> tuple[Event, ...]:
    """Events that a resumed session starts from; what was mended counts as it says."""
    raw: list[dict[str, Any]] = []
    for record in records:
        if record["kind"] == "event":
            raw.append(record["event"])
        elif record["kind"] == "mended":
            raw = list(record["events"])
    return tuple(_event(e) for e in raw if e["kind"] in DURABLE)


def event_record(event: Event) -> Record:
    """What the journal keeps of an event; of its reasons, the text."""
    return {name: value for name, value in asdict(event).items() if name != "reasons"}


def _event(raw: dict[str, Any]) -> Event:
    dwell, reference = raw["dwell"], raw["reference"]
    return Event(
        **{
            **raw,
            "dwell": AcceptedDwell(**_tuples(dwell)) if dwell else None,
            "reference": Reference(**_tuples(reference)) if reference else None,
        }
    )


def _tuples(raw: dict[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in raw.items()}


def known_log(records: Sequence[Record]) -> LogState | None:
    """What the log began with when the journal last hashed it."""
    states = (r["log"] for r in reversed(records) if "sha256" in r.get("log", {}))
    return next(states, None)


def session_folders(root: Path) -> list[Path]:
    """Folders of the sessions of a unit, the oldest first."""
    if not root.is_dir():
        return []
    return sorted(f for f in root.iterdir() if _NUMBERED.fullmatch(f.name) and f.is_dir())


def next_folder(root: Path) -> Path:
    """Folder of a new session.

    Raises
    ------
    RefusedError
        When another process has the last one: a unit is in one session at a time.
    """
    there = session_folders(root)
    if not there:
        return root / "001"
    with Lock(there[-1] / LOCK_FILE, "a session"):
        return root / f"{int(there[-1].name) + 1:03d}"
