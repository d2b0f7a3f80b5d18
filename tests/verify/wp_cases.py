"""Workspaces of WP's tests, and mistakes planted in the C or in the specification."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from triaxcal.codegen.render import annotated_routine, render_routine
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.verify import wp
from triaxcal.verify.workspace import Workspace

C, SPECIFICATION = "annotated_routine", "specification"
"""Names of what gives the texts that WP reads."""


def workspace_of(plan: Plan, folder: Path) -> Workspace:
    """The routine of a plan."""
    files = {name: text.encode() for name, text in render_routine(plan).items()}
    return Workspace.create(folder, files, plan, prove(plan))


def plant(monkeypatch: pytest.MonkeyPatch, text: str, old: str, new: str) -> None:
    """Replace the first `old` in a text wherever WP asks for it."""
    original: Callable[..., str] = getattr(wp, text)

    def changed(*args: object, **options: object) -> str:
        return original(*args, **options).replace(old, new, 1)

    monkeypatch.setattr(wp, text, changed)


def refuse_proof(
    work: Workspace, monkeypatch: pytest.MonkeyPatch, mistake: tuple[str, str, str, str]
) -> None:
    """Fail where a function's goals are proven in spite of a mistake.

    `mistake` is the text that has it, the function, what it replaces and by what.
    """
    text, function, old, new = mistake
    assert old in annotated_routine(work.plan) + wp.specification(work.plan, opaque=False)
    plant(monkeypatch, text, old, new)
    wp.write_texts(work, work.folder / "wp")
    place = wp.prepared(work, work.folder / "wp")
    (part,) = wp.parts_of([function])
    assert wp.is_proven(place, part, 5) is False
