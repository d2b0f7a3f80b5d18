"""`triaxcal rig status`, and the session that `rig resume` goes on with."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import example
from triaxcal.cli.rig_options import SESSIONS, status_options

if TYPE_CHECKING:
    from triaxcal.rig.many.setup import ManySetup
    from triaxcal.rig.records.journal import ReadJournal
    from triaxcal.rig.session.engine import Setup
    from triaxcal.rig.session.events import Event


@click.command(
    epilog=example("triaxcal rig status --unit AT-7", "triaxcal rig status --plan chamber.toml")
)
@status_options
@SESSIONS
def status(setup: Setup | ManySetup, sessions: Path | None) -> None:
    """List the sessions of a unit or plan, and what they hold."""
    from triaxcal.rig.records.journal import read_journal  # noqa: PLC0415
    from triaxcal.rig.records.recording import JOURNAL_FILE, session_folders  # noqa: PLC0415

    root = sessions or setup.sessions
    folders = session_folders(root)
    for folder in folders:
        path = folder / JOURNAL_FILE
        if path.exists():
            _show(setup, folder, read_journal(path))
        else:
            click.echo(f"{folder}: no journal, nothing was recorded")
    if not folders:
        click.echo(f"{root}: no session")


def _show(setup: Setup | ManySetup, folder: Path, found: ReadJournal) -> None:
    """What one session holds."""
    by_unit, asides = _held(setup, found)
    count = sum(event.dwell is not None for events in by_unit.values() for event in events)
    click.echo(f"{folder}: {count} accepted dwells, {len(found.records)} records")
    for name, events in by_unit.items():
        dwells = [event for event in events if event.dwell is not None]
        if name:
            aside = f"; set aside: {asides[name]}" if name in asides else ""
            click.echo(f"  {name}: {len(dwells)} accepted dwells{aside}")
        for event in dwells:
            click.echo(f"  {event.text}" if not name else f"    {event.text}")
    if found.damaged:
        click.echo(
            f"  journal damaged: {len(found.later)} records behind the damage are whole and not "
            f"shown, {found.lost} are lost; `triaxcal rig resume` goes on from what is whole"
        )
    elif found.torn:
        click.echo(
            "  journal incomplete at its end, as after a crash: only the records above are used"
        )


def _held(
    setup: Setup | ManySetup, found: ReadJournal
) -> tuple[Mapping[str, Sequence[Event]], Mapping[str, str]]:
    """Durable events of each unit, under "" of the only one; why units were set aside."""
    from triaxcal.rig.many.mend import events_of  # noqa: PLC0415
    from triaxcal.rig.many.setup import ManySetup  # noqa: PLC0415
    from triaxcal.rig.records.recording import durable_events  # noqa: PLC0415

    if not isinstance(setup, ManySetup):
        return {"": durable_events(found.records)}, {}
    asides = {r["unit"]: str(r["text"]) for r in found.records if r["kind"] == "aside"}
    return events_of(setup, found.records), asides


def last_session(root: Path) -> Path:
    """Folder of the last session.

    Raises
    ------
    RefusedError
        When there is none.
    """
    from triaxcal.rig.records.recording import session_folders  # noqa: PLC0415

    there = session_folders(root)
    if not there:
        raise RefusedError(
            str(root), "no session in it", remedy="start one with `triaxcal rig run`"
        )
    return there[-1]


def mended(setup: Setup | ManySetup, folder: Path, agreed: bool) -> None:
    """Mend a damaged journal when the operator agrees.

    Raises
    ------
    RefusedError
        When nobody agrees, or it cannot be mended.
    """
    from triaxcal.rig.many.mend import described_many, mend_many  # noqa: PLC0415
    from triaxcal.rig.many.setup import ManySetup  # noqa: PLC0415
    from triaxcal.rig.records import mend  # noqa: PLC0415

    found = mend.damage(folder)
    if found is None:
        return
    if isinstance(setup, ManySetup):
        text = described_many(setup, folder, found)
    else:
        text = mend.described(folder, found)
    if not agreed and sys.stdin.isatty():
        click.echo(text)
        agreed = click.confirm("Go on from what is whole? The damaged journal is kept")
    if not agreed:
        raise RefusedError(text, "not gone on with", remedy="agree to it with --mend")
    done = mend_many(setup, folder) if isinstance(setup, ManySetup) else mend.mend(setup, folder)
    rebuilt = "; the log gave again what was lost" if done.complete else ""
    click.echo(f"mended: {done.dwells} accepted dwells{rebuilt}; damaged one: {done.kept_as}")
