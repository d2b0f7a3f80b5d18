"""A damaged journal made usable again, without losing what is good.

Every record has a check of its own, so those behind the damage are known to be whole. What the lost
ones held, the log gives again, unless a lost one was a word of the operator or a restart.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from triaxcal.base.durable import replace_file
from triaxcal.base.errors import RefusedError
from triaxcal.rig.records.journal import ReadJournal, disk_refusal, read_journal, written
from triaxcal.rig.records.lock import Lock
from triaxcal.rig.records.recording import (
    JOURNAL_FILE,
    LOCK_FILE,
    LOG_FILE,
    durable_events,
    event_record,
    header,
    refuse_other_session,
)
from triaxcal.rig.records.replay import contains, replay_records
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.session.events import Event


@dataclass(frozen=True)
class Mended:
    """What was made of a damaged journal.

    Attributes
    ----------
    events : tuple of Event
        Durable events that the session goes on from.
    complete : bool
        Whether the log gave again what the lost records held.
    kept_as : Path
        The damaged journal as it was.
    """

    events: tuple[Event, ...]
    complete: bool
    kept_as: Path

    @property
    def dwells(self) -> int:
        """Accepted dwells among the events."""
        return sum(event.dwell is not None for event in self.events)


def damage(folder: Path) -> ReadJournal | None:
    """Journal of a session where it is damaged; None where it is not.

    Raises
    ------
    RefusedError
        When it cannot be read.
    """
    path = folder / JOURNAL_FILE
    found = read_journal(path) if path.exists() else None
    return found if found is not None and found.damaged else None


def described(folder: Path, found: ReadJournal) -> str:
    """What is whole and what is not, in one line."""
    return described_by(folder, found, durable_events((*found.records, *found.later)))


def described_by(folder: Path, found: ReadJournal, events: Iterable[Event]) -> str:
    """What is whole and what is not, with these durable events, in one line."""
    dwells = [event for event in events if event.dwell is not None]
    return (
        f"{folder / JOURNAL_FILE}: damaged behind its {len(found.records)} good records; "
        f"{len(found.later)} behind the damage are whole, {found.lost} are lost; "
        f"{len(dwells)} accepted dwells are whole"
    )


def mend(setup: Setup, folder: Path) -> Mended:
    """Write a journal that a session can go on with; the damaged one is kept beside it.

    Raises
    ------
    RefusedError
        When another process has the session, the log was changed as well, the journal is about
        another unit, plan or DBC, or its first record is lost and nothing proves what it was about.
    """
    path = folder / JOURNAL_FILE
    with Lock(folder / LOCK_FILE, "a session"):
        found = read_journal(path)
        known = (*found.records, *found.later)
        about = found.records[:1] or (header(setup),)
        refuse_other_session(path, about[0], setup)
        played = replay_records(setup, folder / LOG_FILE, known)
        events, again = durable_events(known), tuple(played.engine.session.durable)
        complete = contains(again, events)
        if not found.records and not (events and complete):
            raise RefusedError(
                str(path),
                "its first record is damaged, which names unit, plan and DBC, and nothing in the "
                "log proves them",
                remedy="start a new session with `triaxcal rig run`",
            )
        mended = Mended(again if complete else events, complete, beside(path))
        record = {
            "kind": "mended",
            "kept_as": mended.kept_as.name,
            "lost": found.lost,
            "complete": complete,
            "events": [event_record(event) for event in mended.events],
            "log": played.log,
        }
        try:
            replace_file(mended.kept_as, path.read_bytes())
            replace_file(path, written((*(found.records or about), record)))
        except OSError as error:
            raise disk_refusal(path, error) from error
    return mended


def beside(path: Path) -> Path:
    """Name for the damaged journal, which no file has."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    names = (f"{path.name}.damaged-{stamp}{f'-{n}' if n else ''}" for n in range(1000))
    return next(p for p in map(path.with_name, names) if not p.exists())
