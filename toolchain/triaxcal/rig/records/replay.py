"""A session made again from its log and its journal."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.lines import LineFormat
from triaxcal.rig.logs.linelog import frames_of_log
from triaxcal.rig.logs.logfile import Left
from triaxcal.rig.records.journal import ReadJournal, Record, read_journal
from triaxcal.rig.records.rawlog import LogState, changed_log
from triaxcal.rig.records.recording import durable_events, known_log, refuse_other_session
from triaxcal.rig.session.engine import Engine, Setup
from triaxcal.rig.session.events import Agree, Event, Redo

_PIECE = 1 << 20
"""Bytes hashed at once."""
WORDS = frozenset({"command", "resume", "mended"})
"""Kinds of records that a log alone does not give again."""


@dataclass(frozen=True)
class Replayed:
    """A session played again from its log.

    Attributes
    ----------
    log : dict
        Lines, bytes and SHA-256 of the log.
    notes : tuple of str
        What of the log and the journal could not be used.
    """

    engine: Engine
    events: tuple[Event, ...]
    log: LogState
    notes: tuple[str, ...] = ()


def replay(setup: Setup, log: Path, journal: Path | None = None) -> Replayed:
    """Play a log again, with the operator's commands and the restarts in its journal.

    Raises
    ------
    RefusedError
        When a file cannot be read, the log is not the one that the journal was written beside,
        or it is another unit's.
    """
    if journal is None:
        return replay_records(setup, log, ())
    found = read_journal(journal)
    records = (*found.records, *found.later)
    if records:
        refuse_other_session(journal, records[0], setup)
    played = replay_records(setup, log, records)
    return replace(played, notes=(*played.notes, *_notes(journal, found, played)))


def _notes(journal: Path, found: ReadJournal, played: Replayed) -> tuple[str, ...]:
    if not found.damaged:
        return ()
    known = durable_events((*found.records, *found.later))
    again = "the log gives all other decisions again"
    if not contains(played.engine.session.durable, known):
        again = "the log does not give the same decisions again: a lost record changed them"
    return (f"{journal}: damaged, {found.lost} records lost; {again}",)


def contains(events: Sequence[Event], some: Iterable[Event]) -> bool:
    """Whether some events are among others, in the same order."""
    others = iter(events)
    return all(event in others for event in some)


def replay_records(setup: Setup, log: Path, records: Sequence[Record]) -> Replayed:
    """Play a log again with the records of its journal.

    Raises
    ------
    RefusedError
        As `replay`.
    """
    state = log_state(log, known_log(records))
    engine = Engine(setup, str(log))
    words = [r for r in records if r["kind"] in WORDS]
    events: list[Event] = []
    lines, left = 0, Left()
    cuts = [int(r["log"]["lines"]) for r in words]
    for frames in chunks(log, setup.rig.lines, cuts, left):
        while words and int(words[0]["log"]["lines"]) == lines:
            events += say(engine, words.pop(0))
        events += engine.feed(frames)
        lines += len(frames)
    for word in words:
        events += say(engine, word)
    return Replayed(engine, tuple(events), state, tuple(left.notes(log)))


def say(engine: Engine, record: Record) -> list[Event]:
    """Decisions of a session after a command or a restart of its journal."""
    if record["kind"] == "resume":
        # A decision that the crash kept from the journal was not taken.
        engine.resume(int(record["durable"]))
        return []
    if record["kind"] == "mended":
        engine.restore(durable_events((record,)))
        return []
    said = dict(record["command"])
    name, t_ns = said.pop("name"), said.pop("t_ns")
    return engine.command(Agree() if name == "Agree" else Redo(**said), t_ns)


def chunks(log: Path, form: LineFormat | None, cuts: list[int], left: Left) -> Iterator[Frames]:
    """Frames of a log, cut after each of these numbers of lines; what is none is counted."""
    done = 0
    for parsed in frames_of_log(log, form):
        left.add(parsed)
        inner = [c - done for c in cuts if done < c < done + parsed.lines]
        if cuts and parsed.bad_lines and parsed.lines:
            raise RefusedError(
                str(log),
                f"{parsed.bad_lines} lines that are no frames",
                expected="frames alone, as the journal beside it counts its lines",
            )
        if parsed.untimed:
            raise RefusedError(
                str(log),
                f"{parsed.untimed} frames have no time",
                expected="a log with times",
                remedy="record with `candump -l` or `candump -t a`",
            )
        left.refuse_differences(log)
        for start, end in pairwise([0, *inner, len(parsed.frames)]):
            yield parsed.frames.take(slice(start, end))
        done += parsed.lines


def log_state(log: Path, known: LogState | None = None) -> LogState:
    """Whole lines of a log, their bytes and SHA-256.

    Raises
    ------
    RefusedError
        When the log cannot be read, or its beginning is not what is known of it.
    """
    seam = int(known["bytes"]) if known else 0
    running = hashlib.sha256()
    whole_lines = running.copy()
    at = size = lines = 0
    try:
        with log.open("rb") as file:
            while chunk := file.read(min(_PIECE, seam - at) if at < seam else _PIECE):
                cut = chunk.rfind(b"\n") + 1
                running.update(chunk[:cut])
                if cut:
                    size, whole_lines = at + cut, running.copy()
                running.update(chunk[cut:])
                lines += chunk.count(b"\n")
                at += len(chunk)
                if at == seam:
                    _refuse_changed_log(log, running.hexdigest(), known)
    except OSError as error:
        raise refused_by_system(log, "read", error) from error
    if at < seam:
        _refuse_changed_log(log, running.hexdigest(), known)
    return {"lines": lines, "bytes": size, "sha256": whole_lines.hexdigest()}


def _refuse_changed_log(log: Path, found: str, known: LogState | None) -> None:
    """Refuse a log whose beginning is not what the journal saw."""
    if known is not None and found != known["sha256"]:
        raise changed_log(
            log,
            f"its first {known['bytes']} bytes have SHA-256 {found[:16]}...",
            f"{str(known['sha256'])[:16]}..., as the journal recorded",
        )
