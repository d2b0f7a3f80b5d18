"""The outcomes in verification.json, beside what the delivery wrote there."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.jsontext import json_bytes
from triaxcal.verify.outcome import Outcome

FILE = "verification.json"
SECTION = "tools"
RENEWED = ("passport.html", "passport.json", "dynamic.html")
"""Written again with the outcomes."""


def is_delivered(target: Path, files: Mapping[str, bytes]) -> bool:
    """Whether `target` holds these files; in verification.json sections may have been added."""
    for name, content in files.items():
        path = target / name
        if not path.is_file():
            return False
        if name in RENEWED:
            continue
        found = path.read_bytes()
        if name == FILE:
            base, present = json.loads(content), _load(found, path)
            if any(present.get(key) != value for key, value in base.items()):
                return False
        elif found != content:
            return False
    return True


def refuse_edited(target: Path) -> None:
    """Refuse a folder of which a file is no longer the one that was delivered there.

    Raises
    ------
    RefusedError
    """
    path = target / FILE
    if not path.is_file():
        return
    for name, digest in _load(path.read_bytes(), path).get("files_sha256", {}).items():
        file = target / name
        if file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            raise RefusedError(
                str(file),
                "is not the file that was delivered, so nothing was verified",
                expected=f"SHA-256 {digest[:16]}..., as in {FILE}",
                remedy="delete it and run this again: the delivered one is then written",
            )


def entries(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Outcomes as verification.json keeps them."""
    return {outcome.key: outcome.json() for outcome in outcomes}


def tools_of(target: Path) -> dict[str, Any]:
    """Section of the tools in verification.json of a delivery; empty when none have been run.

    Raises
    ------
    RefusedError
        When the file is no JSON object.
    """
    path = target / FILE
    return dict(_load(path.read_bytes(), path).get(SECTION) or {})


def record(target: Path, section: Mapping[str, Any]) -> dict[str, Any]:
    """Add outcomes to the section of the tools in verification.json, and return the section.

    A check that was done now replaces its outcome; what other checks found stays. The new file is
    written beside the old one and takes its place when it is complete.

    Raises
    ------
    RefusedError
        When the file cannot be read or written.
    """
    path = target / FILE
    document = _load(path.read_bytes(), path)
    document[SECTION] = _merged(document.get(SECTION, {}), section)
    content = json_bytes(document)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{FILE}.", dir=target)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(name).chmod(path.stat().st_mode)
            Path(name).replace(path)
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        remedy = "free some space or name another folder"
        raise refused_by_system(path, "written", error, remedy=remedy) from error
    done: dict[str, Any] = document[SECTION]
    return done


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of checks, or groups of them: only an entry has a result."""
    return dict(old) | {
        name: value if "result" in value else _merged(old.get(name, {}), value)
        for name, value in new.items()
    }


def _load(content: bytes, path: Path) -> dict[str, Any]:
    try:
        document = json.loads(content)
    except ValueError:
        document = None
    if not isinstance(document, dict):
        raise RefusedError(str(path), "is no JSON object", remedy="run triaxcal calib again")
    return document
