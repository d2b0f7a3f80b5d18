"""The generated C of each shape, made once a session, and tools that may be missing."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from triaxcal.verify.shapes import ALL_SHAPES, SHAPES, Subject, subject
from triaxcal.verify.workspace import ROUTINE, Workspace

UNITS = Path(__file__).parent.parent.parent / "units"

Planter = Callable[..., Workspace]


@pytest.fixture(scope="session")
def subjects() -> dict[str, Subject]:
    return {name: subject(name, UNITS) for name in ALL_SHAPES}


@pytest.fixture
def plant(subjects: dict[str, Subject], tmp_path: Path) -> Planter:
    """A workspace of a shape, with texts of its routine replaced: each must occur."""

    def make(shape: str, *changes: tuple[str, str]) -> Workspace:
        made = subjects[shape]
        text = made.files[ROUTINE].decode()
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        changed = replace(made, files={**made.files, ROUTINE: text.encode()})
        return Workspace.create(tmp_path / "work", changed.files, made.plan, made.bound)

    return make


SHAPES_FAST_FIRST = [
    name if name == "direct-two-segments" else pytest.param(name, marks=pytest.mark.slow)
    for name in SHAPES
]
"""One shape in every run, all of them in the nightly one."""


def needs(*programs: str) -> pytest.MarkDecorator:
    """Skip, by name, where a program is not installed."""
    missing = [p for p in programs if shutil.which(p) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")
