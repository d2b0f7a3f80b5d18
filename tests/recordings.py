"""Real recordings of other makers, which the project does not hold: where they are, if anywhere."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

FOLDER = Path(os.environ.get("TRIAXCAL_RECORDINGS", Path(__file__).parents[2] / "shared" / "data"))
ABSENT = "real recordings absent"


def recording(name: str) -> Path:
    """The folder of a recording; skips the test, and tells so at the end, where it is absent."""
    folder = FOLDER / name
    if not folder.is_dir():
        pytest.skip(f"{ABSENT}: no {name}/ in {FOLDER} (TRIAXCAL_RECORDINGS names another folder)")
    return folder
