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
from triaxcal.rig.records.replay import chunks, log_state, say
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
    path = folder / JOURNAL_FILE
    records = read_journal(path).records
    here = [p for p in setup.places if p.bus == bus and p.name in names]
    engines = {p.name: Engine(p.setup, bus) for p in here}
    log = folder / log_file(setup.buses.index(bus) + 1)
    state = log_state(log, known_log([r for r in records if r.get("bus") == bus]))
    if not here:
        return {}, state
    words = [r for r in records if r["kind"] in {"command", "resume"} and r["unit"] in engines]
    parts = chunks(log, here[0].setup.rig.lines, [int(r["log"]["lines"]) for r in words], Left())
    _play(parts, Splitter([p.setup.rig for p in here]), engines, words)
    for name, engine in engines.items():
        known = [e.dwell for e in durable_events(of_unit(records, name)) if e.dwell is not None]
        again = [e.dwell for e in engine.session.durable if e.dwell is not None]
        if again != known:
            raise RefusedError(
                f"{log}, {name}",
                "gives other dwells than the journal",
                remedy="report this session",
            )
    return {name: engine.session for name, engine in engines.items()}, state


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
