"""Rig descriptions by name: those that came with triaxcal, or a path."""

from __future__ import annotations

from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.base.tomltable import did_you_mean
from triaxcal.rig.description.rigkeys import RIG_FILE


def descriptions_folder() -> Path:
    """Folder of the descriptions that came with triaxcal."""
    return shipped("rig") / "descriptions"


def shipped_descriptions() -> list[str]:
    """Names of the descriptions that came with triaxcal."""
    return sorted(f.name for f in descriptions_folder().iterdir() if (f / RIG_FILE).is_file())


def find_description(name: str, beside: Path | None = None) -> Path:
    """rig.toml of a shipped name or a path; a relative one starts at the folder `beside`.

    Raises
    ------
    RefusedError
        When there is none.
    """
    if name in shipped_descriptions():
        return descriptions_folder() / name / RIG_FILE
    path = (beside or Path()) / name
    path = path / RIG_FILE if path.is_dir() else path
    if not path.is_file():
        known = shipped_descriptions()
        raise RefusedError(
            name,
            f"no such rig description{did_you_mean(name, known)}",
            expected=f"a file {RIG_FILE}, or one of " + ", ".join(known),
            remedy="`triaxcal init --rig FILE.dbc` writes one from a bus description",
        )
    return path
