"""A session made again from its log and its journal."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.candump import read_log
from triaxcal.rig.engine import Engine, Setup
from triaxcal.rig.events import Agree, Event, Redo
from triaxcal.rig.frames import Frames
from triaxcal.rig.journal import Record, read_journal
from triaxcal.rig.rawlog import LogState, changed_log
from triaxcal.rig.recording import known_log, refuse_other_session


@dataclass(frozen=True)
class Replayed:
    """A session played again from its log.

    Attributes
    ----------
    log : dict
        Lines, bytes and SHA-256 of the log; lines that were no frame.
    """

    engine: Engine
    events: tuple[Event, ...]
    log: LogState
    bad_lines: int


def replay(setup: Setup, log: Path, journal: Path | None = None) -> Replayed:
    """Play a log again, with the operator's commands and the restarts in its journal.

    Raises
    ------
    RefusedError
        When a file cannot be read, the log is not the one that the journal was written beside,
        or it is another unit's.
    """
    records = read_journal(journal).records if journal is not None else ()
    if records and journal is not None:
        refuse_other_session(journal, records[0], setup)
        _refuse_changed_log(log, records)
    engine = Engine(setup, str(log))
    words = [r for r in records if r["kind"] in {"command", "resume"}]
    events: list[Event] = []
    lines = bad = 0
    for parsed, frame_lines in _chunks(log, [int(r["log"]["lines"]) for r in words]):
        while words and int(words[0]["log"]["lines"]) == lines:
            events += _say(engine, words.pop(0))
        events += engine.feed(parsed)
        lines += frame_lines[0]
        bad += frame_lines[1]
    for word in words:
        events += _say(engine, word)
    return Replayed(engine, tuple(events), log_state(log), bad)


def _say(engine: Engine, record: Record) -> list[Event]:
    if record["kind"] == "resume":
        # A decision that the crash kept from the journal was not taken.
        engine.resume(int(record["durable"]))
        return []
    said = dict(record["command"])
    name, t_ns = said.pop("name"), said.pop("t_ns")
    return engine.command(Agree() if name == "Agree" else Redo(**said), t_ns)


def _chunks(log: Path, cuts: list[int]) -> Iterator[tuple[Frames, tuple[int, int]]]:
    """Frames of a log, cut after each of these numbers of lines; lines and bad lines of each."""
    done = 0
    for parsed in read_log(log):
        inner = [c - done for c in cuts if done < c < done + parsed.lines]
        if inner and parsed.bad_lines:
            raise RefusedError(str(log), f"{parsed.bad_lines} lines that are no frames")
        edges = [0, *inner, len(parsed.frames)]
        for i, (start, end) in enumerate(pairwise(edges)):
            bad = parsed.bad_lines if i == 0 else 0
            yield parsed.frames.take(slice(start, end)), (end - start + bad, bad)
        done += parsed.lines


def _refuse_changed_log(log: Path, records: tuple[Record, ...]) -> None:
    """Refuse a log whose beginning is not what the journal saw."""
    known = known_log(records)
    if known is None:
        return
    try:
        with log.open("rb") as file:
            found = hashlib.sha256(file.read(int(known["bytes"]))).hexdigest()
    except OSError as error:
        raise RefusedError(str(log), f"cannot be read: {error.strerror}") from error
    if found != known["sha256"]:
        raise changed_log(
            log,
            f"its first {known['bytes']} bytes have SHA-256 {found[:16]}...",
            f"{str(known['sha256'])[:16]}..., as the journal recorded",
        )


def log_state(log: Path) -> LogState:
    """Whole lines of a log, their bytes and SHA-256."""
    content = np.memmap(log, np.uint8, "r") if log.stat().st_size else np.zeros(0, np.uint8)
    ends = np.flatnonzero(content == ord("\n"))
    size = int(ends[-1]) + 1 if len(ends) else 0
    return {
        "lines": len(ends),
        "bytes": size,
        "sha256": hashlib.sha256(content[:size].tobytes()).hexdigest(),
    }
