"""What is installed, as a table; and what is missing, with the command that installs it."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

INSTALLED = "installed"
_FOUND = 14
"""Columns of what is found."""
_VERSION = re.compile(r"(?<![\w.:])\d+(?:\.\d+)+(?![\w.])")


@dataclass(frozen=True)
class InstalledPart:
    """Something that triaxcal can use.

    Attributes
    ----------
    group, name : str
        What kind of thing it is, and what it is called.
    found : str
        Its version or what is there; "" where it is missing.
    purpose : str
        What triaxcal does with it.
    install : str
        Where it is missing, the command that installs it, if there is one.
    needed : bool
        Whether `calib` does not work without it.
    """

    group: str
    name: str
    found: str
    purpose: str
    install: str = ""
    needed: bool = False


@dataclass(frozen=True)
class Installation:
    """What is installed of what triaxcal can use.

    Attributes
    ----------
    version : str
        Of triaxcal.
    documentation : str
        Folder of its pages, in Markdown.
    parts : tuple of InstalledPart
    """

    version: str
    documentation: str
    parts: tuple[InstalledPart, ...]

    @property
    def works(self) -> bool:
        """Whether `triaxcal calib` can work."""
        return all(part.found for part in self.parts if part.needed)

    @property
    def summary(self) -> str:
        """Table of the parts, the commands that install what is missing, the verdict."""
        lines = [f"triaxcal {self.version}; documentation: {self.documentation}"]
        width = max(len(part.name) for part in self.parts)
        for group, parts in groupby(self.parts, lambda part: part.group):
            lines += ["", group]
            lines += [_row(part, width) for part in parts]
        missing = [part for part in self.parts if not part.found and part.install]
        if missing:
            lines += ["", "to install what is missing"]
            lines += [f"  {part.name:{width}}  {part.install}" for part in missing]
        works = "works" if self.works else "cannot work: see what is MISSING"
        return "\n".join([*lines, "", f"triaxcal calib {works}"])

    def document(self) -> dict[str, Any]:
        """The same for a JSON document."""
        return {"format": 1, **asdict(self), "works": self.works}


def _row(part: InstalledPart, width: int) -> str:
    found, purpose = part.found or ("MISSING" if part.needed else "-"), part.purpose
    versions = _VERSION.findall(found)
    if len(set(versions)) == 1:
        found = versions[0]
    elif len(found) > _FOUND:
        found, purpose = INSTALLED, f"{purpose} ({found})"
    return f"  {part.name:{width}}  {found:{_FOUND}}  {purpose}".rstrip()
