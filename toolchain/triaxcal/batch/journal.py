"""series.jsonl in the build folder: one line for each unit made, so that a run can go on.

A line is written once a unit's files are in place. A line that a crash tore in two is left out;
its unit is made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from triaxcal.base.errors import refused_by_system
from triaxcal.base.publish import renew
from triaxcal.batch.order import Outcome

JOURNAL_FILE = "series.jsonl"
FORMAT = 1
RENEWED = ("verification.json", "passport.html", "passport.json", "dynamic.html")
"""Files that `triaxcal verify` may renew after the unit was made."""


def read_journal(build: Path) -> dict[str, dict[str, Any]]:
    """Last line of each unit, by its name; empty when there is no journal."""
    try:
        text = (build / JOURNAL_FILE).read_bytes().decode("utf-8", "replace")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise refused_by_system(build / JOURNAL_FILE, "read", error) from error
    found: dict[str, dict[str, Any]] = {}
    for line in text.splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict) and entry.get("format") == FORMAT:
            found[str(entry.get("unit"))] = entry
    return found


def entry_of(outcome: Outcome) -> dict[str, Any]:
    """Line of a unit that passed."""
    return {
        "format": FORMAT,
        "unit": outcome.name,
        "key": outcome.key,
        "files_sha256": {n: hashlib.sha256(c).hexdigest() for n, c in outcome.files.items()},
        "record": outcome.record,
    }


def append(build: Path, entry: dict[str, Any]) -> None:
    """Add a line.

    Raises
    ------
    RefusedError
        When the disk refuses.
    """
    path = build / JOURNAL_FILE
    try:
        build.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as file:
            # After a torn line a new one begins.
            if file.tell():
                file.seek(-1, 2)
                if file.read(1) != b"\n":
                    file.write(b"\n")
            file.write(_line(entry))
    except OSError as error:
        raise refused_by_system(path, "written", error) from error


def rewrite(build: Path, entries: Iterable[dict[str, Any]]) -> None:
    """Give the journal one line a unit again."""
    renew({JOURNAL_FILE: b"".join(map(_line, entries))}, build)


def intact(build: Path, entry: dict[str, Any]) -> bool:
    """Whether the files of a unit are there as they were made; `RENEWED` ones are there."""
    folder = build / entry["unit"]
    for name, digest in entry["files_sha256"].items():
        path = folder / name
        try:
            if name in RENEWED:
                if not path.is_file():
                    return False
            elif hashlib.sha256(path.read_bytes()).hexdigest() != digest:
                return False
        except OSError:
            return False
    return True


def _line(entry: dict[str, Any]) -> bytes:
    return (json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n").encode()
