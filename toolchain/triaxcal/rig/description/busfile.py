"""Bus descriptions: DBC, KCD, SYM and ARXML, read through cantools."""

from __future__ import annotations

import codecs
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cantools
from cantools.database import Database

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.rig.description.layout import FrameLayout, layout_of

_DECLARED = re.compile(r"\s+encoding=[\"'][^\"']*[\"']")
SUFFIXES = (".dbc", ".kcd", ".sym", ".arxml")
_BIT_TIMING = re.compile(r"^(\s*BS_\s*:)[^\S\n]*[^\s][^\n]*$", re.MULTILINE)
"""Obsolete: "BS_: 1000000 : 0,0"."""


@dataclass(frozen=True)
class BusFile:
    """One file.

    Attributes
    ----------
    sha256 : str
        Of its content.
    warnings : tuple of str
        What breaks the letter of its format.
    """

    path: Path
    sha256: str
    database: Database
    warnings: tuple[str, ...]

    def layouts(self) -> Iterator[FrameLayout]:
        """Layouts of its messages."""
        return map(layout_of, self.database.messages)


def read_bus_file(path: Path) -> BusFile:
    """Any bus description; one that breaks the letter of its format where cantools can.

    Raises
    ------
    RefusedError
        When the file cannot be read, or is no bus description.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refused_by_system(path, "read", error) from error
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RefusedError(
            str(path), f"ending {path.suffix!r}", expected="one of " + ", ".join(SUFFIXES)
        )
    text = _text(content)
    sha256 = hashlib.sha256(content).hexdigest()
    warnings: list[str] = []
    if suffix == ".dbc" and (found := _BIT_TIMING.search(text)):
        warnings.append(f"{path}: {found[0].strip()!r} is obsolete, not read")
        text = _BIT_TIMING.sub(r"\1", text)
    try:
        return BusFile(path, sha256, _parsed(text, suffix, strict=True), tuple(warnings))
    except Exception as error:  # cantools raises its parser's and its own errors, of many types
        try:
            database = _parsed(text, suffix, strict=False)
        except Exception:
            kind = suffix[1:].upper()
            raise RefusedError(str(path), f"not a {kind}: {_line(error)}") from error
        warnings.append(f"{path}: {_line(error)}; read all the same")
        return BusFile(path, sha256, database, tuple(warnings))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _text(content: bytes) -> str:
    """Text of a file; DBCs are in Windows' code page where they are not in UTF-8."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        # Text is parsed, which has no encoding: what an XML declaration says would be wrong.
        return _DECLARED.sub("", content.decode("utf-16", errors="replace"), count=1)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _parsed(text: str, suffix: str, strict: bool) -> Database:
    database = cantools.database.can.Database(strict=strict)
    if not text.strip():
        return database
    getattr(database, f"add_{suffix[1:]}_string")(text)
    return database
