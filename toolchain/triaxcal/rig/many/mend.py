"""A damaged journal of many units made usable again, as `records.mend` does of one unit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from triaxcal.base.durable import replace_file
from triaxcal.base.errors import RefusedError
from triaxcal.rig.many.recording import header_of, of_unit, refuse_other_units
from triaxcal.rig.many.replay import play_bus
from triaxcal.rig.many.setup import ManySetup
from triaxcal.rig.records.journal import ReadJournal, Record, disk_refusal, read_journal, written
from triaxcal.rig.records.lock import Lock
from triaxcal.rig.records.mend import Mended, beside, described_by
from triaxcal.rig.records.recording import (
    JOURNAL_FILE,
    LOCK_FILE,
    durable_events,
    event_record,
)
from triaxcal.rig.records.replay import contains
from triaxcal.rig.session.events import Event


def events_of(setup: ManySetup, records: Sequence[Record]) -> dict[str, tuple[Event, ...]]:
    """Durable events of each unit in a journal."""
    return {p.name: durable_events(of_unit(records, p.name)) for p in setup.places}


def described_many(setup: ManySetup, folder: Path, found: ReadJournal) -> str:
    """What is whole and what is not, in one line."""
    by_unit = events_of(setup, (*found.records, *found.later))
    return described_by(folder, found, [e for events in by_unit.values() for e in events])


def mend_many(setup: ManySetup, folder: Path) -> Mended:
    """Write a journal that a session can go on with; the damaged one is kept beside it.

    Units that were set aside stay so where the record of it is whole.

    Raises
    ------
    RefusedError
        When another process has the session, a log was changed as well, the journal is about other
        units or another plan, or its first record is lost and nothing proves what it was about.
    """
    path = folder / JOURNAL_FILE
    with Lock(folder / LOCK_FILE, "a session"):
        found = read_journal(path)
        known = (*found.records, *found.later)
        about = found.records[0] if found.records else header_of(setup)
        refuse_other_units(path, about, setup)
        asides = [r for r in known if r["kind"] == "aside"]
        gone = {r["unit"] for r in asides}
        by_unit, complete = events_of(setup, known), True
        logs: dict[str, Any] = {}
        for bus in setup.buses:
            names = [p.name for p in setup.places if p.bus == bus and p.name not in gone]
            engines, logs[bus] = play_bus(setup, folder, bus, names, known)
            for name, engine in engines.items():
                again = tuple(engine.session.durable)
                if contains(again, by_unit[name]):
                    by_unit[name] = again
                else:
                    complete = False
        if not found.records and not (any(by_unit.values()) and complete):
            raise RefusedError(
                str(path),
                "its first record is damaged, which names units and plan, and nothing in the logs "
                "proves them",
                remedy="start a new session with `triaxcal rig run`",
            )
        events = tuple(e for mine in by_unit.values() for e in mine)
        mended = Mended(events, complete, beside(path))
        records = [
            {
                "kind": "mended",
                "kept_as": mended.kept_as.name,
                "lost": found.lost,
                "complete": complete,
                "events": [event_record(event) for event in by_unit[place.name]],
                "unit": place.name,
                "bus": place.bus,
                "log": logs[place.bus],
            }
            for place in setup.places
        ]
        try:
            replace_file(mended.kept_as, path.read_bytes())
            replace_file(path, written((about, *records, *asides)))
        except OSError as error:
            raise disk_refusal(path, error) from error
    return mended
