"""A session of many units made again from its logs and its journal, bus by bus."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.logs.logfile import Left
from triaxcal.rig.many.recording import log_file, of_unit
from triaxcal.rig.many.setup import ManySetup
from triaxcal.rig.records.journal import Record, read_journal
from triaxcal.rig.records.rawlog import LogState
from triaxcal.rig.records.recording import JOURNAL_FILE, durable_events, known_log
from triaxcal.rig.records.replay import WORDS, chunks, log_state, say
from triaxcal.rig.samples.split import Splitter
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.session import Session


def replay_bus(
    setup: ManySetup, folder: Path, bus: str, names: Collection[str]
) -> tuple[dict[str, Session], LogState]:
    """Sessions of some units of a bus, by name, and the state of its log.

    Raises
    ------
    RefusedError
        When a file cannot be read, the log is not the one that the journal was written beside, or
        gives other dwells.
    """
    records = read_journal(folder / JOURNAL_FILE).records
    engines, state = play_bus(setup, folder, bus, names, records)
    for name, engine in engines.items():
        known = [e.dwell for e in durable_events(of_unit(records, name)) if e.dwell is not None]
        again = [e.dwell for e in engine.session.durable if e.dwell is not None]
        if again != known:
            raise RefusedError(
                f"{engine.where}, {name}",
                "gives other dwells than the journal",
                remedy="report this session",
            )
    return {name: engine.session for name, engine in engines.items()}, state


def play_bus(
    setup: ManySetup, folder: Path, bus: str, names: Collection[str], records: Sequence[Record]
) -> tuple[dict[str, Engine], LogState]:
    """Engines of some units of a bus after its log, by name, and the state of the log.

    Parameters
    ----------
    records : sequence of Record
        Of the journal, with commands and restarts.

    Raises
    ------
    RefusedError
        When the log cannot be read, or is not the one that the journal was written beside.
    """
    here = [p for p in setup.places if p.bus == bus and p.name in names]
    log = folder / log_file(setup.buses.index(bus) + 1)
    engines = {p.name: Engine(p.setup, str(log)) for p in here}
    state = log_state(log, known_log([r for r in records if r.get("bus") == bus]))
    if here:
        words = [r for r in records if r["kind"] in WORDS and r["unit"] in engines]
        cuts = [int(r["log"]["lines"]) for r in words]
        parts = chunks(log, here[0].setup.rig.lines, cuts, Left())
        _play(parts, Splitter([p.setup.rig for p in here]), engines, words)
    return engines, state


def _play(
    parts: Iterable[Frames],
    splitter: Splitter,
    engines: Mapping[str, Engine],
    words: Sequence[Record],
) -> None:
    left = list(words)
    lines = 0

    def say_all() -> None:
        while left and int(left[0]["log"]["lines"]) == lines:
            word = left.pop(0)
            say(engines[word["unit"]], word)

    for frames in parts:
        say_all()
        for engine, part in zip(engines.values(), splitter.split(frames), strict=True):
            engine.feed(part)
        lines += len(frames)
    say_all()
