"""`triaxcal rig`: the bench."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import HELP, example
from triaxcal.cli.rig_imu import imu
from triaxcal.cli.rig_options import (
    PLAIN,
    SECONDS,
    SESSIONS,
    UNATTENDED,
    BusChoice,
    bus_options,
    open_source,
    refuse_missing_bench,
    refuse_other_kind,
    run_options,
    session_options,
    simulated,
)
from triaxcal.cli.rig_sessions import last_session, mended, status
from triaxcal.cli.rig_signals import signals
from triaxcal.rig.sources.source import kind_of

if TYPE_CHECKING:
    from triaxcal.rig.many.setup import ManySetup
    from triaxcal.rig.session.engine import Setup

_SAID = {True: "good ", False: "WRONG", None: "note "}


@click.group(
    context_settings=HELP,
    epilog=example("triaxcal rig run --bus can0 --unit AT-7", "triaxcal rig run --help"),
)
def rig() -> None:
    """Take readings from the tilter rig over CAN."""


@rig.command(
    epilog=example(
        "triaxcal rig run --bus can0 --unit AT-7",
        "triaxcal rig run --bus virtual --unit AT-SIM-BENCH --plain",
        "triaxcal rig run --plan chamber.toml --unattended",
    )
)
@run_options
@SESSIONS
@PLAIN
@UNATTENDED
def run(
    setup: Setup | ManySetup, bus: BusChoice, sessions: Path | None, plain: bool, unattended: bool
) -> None:
    """Guide a session through the plan.

    It ends with measurements.csv in the folder of the unit, or of each unit that the plan lists.
    """
    from triaxcal.cli.rig_live import guide  # noqa: PLC0415
    from triaxcal.cli.rig_many import guide_many  # noqa: PLC0415
    from triaxcal.rig.many.setup import ManySetup  # noqa: PLC0415
    from triaxcal.rig.records.recording import next_folder  # noqa: PLC0415

    folder = next_folder(sessions or setup.sessions)
    if isinstance(setup, ManySetup):
        guide_many(setup, bus, folder, plain, unattended)
    else:
        guide(setup, open_source(setup, bus), folder, plain, unattended)


@rig.command(epilog=example("triaxcal rig resume --bus can0 --unit AT-7"))
@run_options
@SESSIONS
@PLAIN
@click.option(
    "--mend", is_flag=True, help="Go on from what is whole of a damaged journal, without asking."
)
@UNATTENDED
def resume(
    setup: Setup | ManySetup,
    bus: BusChoice,
    sessions: Path | None,
    *,
    plain: bool,
    mend: bool,
    unattended: bool,
) -> None:
    """Go on with the last session, whatever ended it."""
    from triaxcal.cli.rig_live import guide  # noqa: PLC0415
    from triaxcal.cli.rig_many import guide_many  # noqa: PLC0415
    from triaxcal.rig.many.setup import ManySetup  # noqa: PLC0415

    folder = last_session(sessions or setup.sessions)
    mended(setup, folder, mend)
    if isinstance(setup, ManySetup):
        guide_many(setup, bus, folder, plain, unattended)
        return
    guide(setup, open_source(setup, bus), folder, plain, unattended)


@rig.command(epilog=example("triaxcal rig replay --unit AT-7 units/AT-7/sessions/001/frames.log"))
@session_options
@click.argument("log", type=click.Path(path_type=Path))
@click.option(
    "--into",
    type=click.Path(path_type=Path),
    help="Folder that receives the records; the log's own by default.",
)
def replay(setup: Setup, log: Path, into: Path | None) -> None:
    """Make the records of a session again from its log.

    LOG has the frames: frames.log of a session, with its journal beside it, or a recording in any
    format of `rig export` and python-can, also compressed by gzip.
    """
    from triaxcal.cli.rig_live import say_first, show_written  # noqa: PLC0415
    from triaxcal.rig.check.whynot import why_not  # noqa: PLC0415
    from triaxcal.rig.records import recording, replay, store  # noqa: PLC0415

    setup.refuse_unfit()
    target = into or log.parent
    if not target.is_dir():
        raise RefusedError(str(target), "no such folder", remedy="make it, or name another one")
    journal = log.with_name(recording.JOURNAL_FILE)
    evidence = log.name == recording.LOG_FILE and journal.exists()
    say_first(setup.rig)
    played = replay.replay(setup, log, journal if evidence else None)
    for event in played.events:
        if event.kind != "trouble":
            click.echo(event.text)
    for note in played.notes:
        click.echo(note, err=True)
    session = played.engine.session
    if not session.done:
        reason = why_not(setup, log, session, played.events)
        for line in reason.lines:
            click.echo(line, err=True)
        remedy = "go on with `triaxcal rig resume`" if evidence else "see the lines above"
        raise RefusedError(str(log), reason.found, expected="a whole session", remedy=remedy)
    for count, first in session.restless.values():
        click.echo(f"not at rest in {count} s: {first}", err=True)
    show_written(store.write_records(target, session, setup.rig, played.log))


@rig.command(epilog=example("triaxcal rig check --bus can0 --unit AT-7"))
@session_options
@bus_options
@click.option("--seconds", type=click.FloatRange(1.0, 600.0), default=5.0, show_default=True)
def check(setup: Setup, bus: BusChoice, seconds: float) -> None:
    """Check bus, DBC, unit, rate, noise and instruments."""
    from triaxcal.rig.check.check import collect, findings, judged  # noqa: PLC0415
    from triaxcal.rig.check.instrumentcheck import instrument_findings  # noqa: PLC0415

    source = open_source(setup, bus)
    try:
        frames = collect(source, seconds)
        found = [judged(frames), *findings(setup, frames, source.name, source.notes())]
    finally:
        source.close()
    found += instrument_findings(setup.plan.equipment)
    for finding in found:
        click.echo(f"{_SAID[finding.good]}  {finding.text}")
    wrong = sum(finding.good is False for finding in found)
    if wrong:
        raise RefusedError(bus.name, f"{wrong} of {len(found)} checks failed", remedy="see above")


@rig.command(epilog=example("triaxcal rig record --bus can0 --unit AT-7 --seconds 60 frames.log"))
@session_options
@bus_options
@SECONDS
@click.argument("log", type=click.Path(path_type=Path))
def record(setup: Setup, bus: BusChoice, seconds: float | None, log: Path) -> None:
    """Append every frame on the bus to LOG."""
    from triaxcal.rig.records.rawlog import RawLog  # noqa: PLC0415

    source = open_source(setup, bus)
    evidence = RawLog(log, source.name)
    before, end = evidence.lines, time.monotonic() + (seconds or float("inf"))
    try:
        while time.monotonic() < end:
            evidence.append(source.read())
            evidence.flush()
            for note in source.notes():
                click.echo(note, err=True)
    except KeyboardInterrupt:
        click.echo("stopped", err=True)
    finally:
        source.close()
        evidence.close()
    click.echo(f"{log}: {evidence.lines - before} frames")


@rig.command(epilog=example("triaxcal rig simulate --bus vcan0 --unit AT-SIM-BENCH"))
@session_options
@bus_options
@SECONDS
@click.option("--hold", type=int, default=130, show_default=True, help="Seconds in each position.")
def simulate(setup: Setup, bus: BusChoice, seconds: float | None, hold: int) -> None:
    """Simulate a rig on a bus, in real time.

    It turns through the plan's positions.
    """
    from triaxcal.cli.rig_live import simulate_on  # noqa: PLC0415
    from triaxcal.rig.bus.openbus import open_bus  # noqa: PLC0415

    name = bus.name if ":" in bus.name else f"socketcan:{bus.name}"
    refuse_other_kind(setup, kind_of(name))
    sender = open_bus(name, setup.rig.fd)
    simulate_on(sender, simulated(setup, bus), setup.plan, seconds, hold)


@rig.command(epilog=example("triaxcal rig export frames.log frames.mf4"))
@click.argument("log", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
def export(log: Path, target: Path) -> None:
    """Convert a log for other tools.

    LOG is of any format that `rig replay` reads. TARGET ends in .asc, .blf, .csv, .log, .mf4 or
    .parquet.
    """
    refuse_missing_bench()
    from triaxcal.rig.logs.export import export_log  # noqa: PLC0415

    shows = sys.stderr.isatty()

    def written(count: int) -> None:
        if shows:
            click.echo(f"\r{count} frames ...", err=True, nl=False)

    try:
        count, notes = export_log(log, target, written)
    finally:
        if shows:
            click.echo("\r\x1b[K", err=True, nl=False)
    for note in notes:
        click.echo(note, err=True)
    click.echo(f"{target}: {count} frames")


@rig.command(
    epilog=example(
        "triaxcal rig fil --unit AT-SIM-BENCH --samples 1000",
        "triaxcal rig fil --unit AT-7 --bus can0 --listen --samples 1000",
    )
)
@session_options
@click.option("--samples", type=click.IntRange(1), default=100_000, show_default=True)
@click.option(
    "--bus",
    help="Check the node on this CAN device or bus of python-can; without it, one that is built "
    "and started here.",
)
@click.option(
    "--listen", is_flag=True, help="The node has a sensor of its own: compare what it sends."
)
@click.option("--seed", type=int, default=1, show_default=True)
def fil(setup: Setup, samples: int, bus: str | None, listen: bool, seed: int) -> None:
    """Compare the generated C in a node with Python.

    Firmware in the loop: each result must be equal, bit for bit. The node is given raw codes in the
    frames of the DBC. With --listen it sends its own, and its results.
    """
    from triaxcal.cli.rig_fil import firmware_in_the_loop  # noqa: PLC0415

    if listen and bus is None:
        raise click.UsageError("--listen needs the --bus that the node is on")
    done = firmware_in_the_loop(setup, samples, bus, seed, listen)
    rate = done.samples / done.seconds
    lost = f"; {done.lost} more were not whole" if done.lost else ""
    click.echo(f"{done.samples} samples bit for bit, {rate:.0f} a second{lost}")


rig.add_command(imu)
rig.add_command(signals)
rig.add_command(status)
