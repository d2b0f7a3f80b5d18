"""`triaxcal rig`: the bench."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from triaxcal.base.errors import RefusedError

if TYPE_CHECKING:
    from triaxcal.rig.engine import Setup
    from triaxcal.rig.sources import Source

_DEFAULT_PLAN = "five-temperatures.toml"
_NEEDED = ("can", "cantools", "rich")


class _RigGroup(click.Group):
    """Says what to install when the bench's packages are missing."""

    def invoke(self, ctx: click.Context) -> Any:
        missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
        if missing:
            raise RefusedError(
                "triaxcal rig",
                "missing packages: " + ", ".join(missing),
                remedy="install them: pip install 'triaxcal[rig]'",
            )
        return super().invoke(ctx)


@click.group(cls=_RigGroup)
def rig() -> None:
    """Take readings from the tilter rig over CAN."""


def _common(function: Callable[..., None]) -> Callable[..., None]:
    """Options that say what the session is about."""
    for option in (
        click.option("--unit", required=True, help="Name of a folder in units/, or its path."),
        click.option("--plan", type=click.Path(path_type=Path), help="TOML file of the session."),
        click.option("--dbc", type=click.Path(path_type=Path), help="Frames, if not tilter.dbc."),
    ):
        function = option(function)
    return function


def _bus_options(function: Callable[..., None]) -> Callable[..., None]:
    for option in (
        click.option(
            "--bus",
            required=True,
            help="virtual (the simulated rig), a CAN device such as can0, or interface:channel.",
        ),
        click.option("--fault", multiple=True, help="Of the simulated rig: kind@s[:value[:s]]."),
        click.option("--seed", type=int, default=1, help="Of the simulated rig."),
    ):
        function = option(function)
    return function


_SESSIONS = click.option(
    "--sessions",
    type=click.Path(path_type=Path),
    help="Folder of the unit's sessions; sessions/ in the unit's folder by default.",
)


def _setup(unit: str, plan: Path | None, dbc: Path | None) -> Setup:
    from triaxcal.base.shipped import shipped  # noqa: PLC0415
    from triaxcal.rig.dbc import default_dbc, read_dbc  # noqa: PLC0415
    from triaxcal.rig.engine import Setup  # noqa: PLC0415
    from triaxcal.rig.plan import read_plan  # noqa: PLC0415
    from triaxcal.unit.description import read_unit  # noqa: PLC0415

    folder = Path(unit) if "/" in unit else Path("units") / unit
    description = read_unit(folder)
    session_plan = read_plan(plan or shipped("rig") / "plans" / _DEFAULT_PLAN, description)
    return Setup(folder, description, session_plan, read_dbc(dbc or default_dbc()))


def _source(setup: Setup, bus: str, faults: tuple[str, ...], seed: int) -> Source:
    from triaxcal.rig.socketcan import open_socketcan  # noqa: PLC0415
    from triaxcal.rig.sources import BusSource, SimulatedSource, open_bus  # noqa: PLC0415

    is_fd = setup.plan.layout == "fd"
    if bus == "virtual":
        return SimulatedSource(_simulated(setup, faults, seed))
    if faults:
        raise RefusedError("--fault", f"given with --bus {bus}", expected="--bus virtual")
    interface, _, device = bus.rpartition(":")
    if interface in {"", "socketcan"}:
        return open_socketcan(device, is_fd)
    return BusSource(open_bus(bus, is_fd), bus)


def _simulated(setup: Setup, faults: tuple[str, ...], seed: int) -> Any:
    from triaxcal.rig.simorders import read_fault  # noqa: PLC0415
    from triaxcal.rig.simulator import RigSettings, SimulatedRig  # noqa: PLC0415
    from triaxcal.simulation.truth import read_truth  # noqa: PLC0415

    truth, _ = read_truth(setup.folder)
    return SimulatedRig(
        setup.unit,
        truth,
        setup.plan,
        setup.dbc,
        RigSettings(seed=seed),
        tuple(read_fault(order) for order in faults),
    )


@rig.command()
@_common
@_bus_options
@_SESSIONS
@click.option("--plain", is_flag=True, help="One line an event, for logs and CI.")
def run(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    bus: str,
    fault: tuple[str, ...],
    seed: int,
    sessions: Path | None,
    plain: bool,
) -> None:
    """Guide a session through the plan; ends with measurements.csv in the unit's folder."""
    from triaxcal.cli.rig_live import guide  # noqa: PLC0415
    from triaxcal.rig.recording import next_folder  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    source = _source(setup, bus, fault, seed)
    guide(setup, source, next_folder(sessions or setup.folder / "sessions"), plain)


@rig.command()
@_common
@_bus_options
@_SESSIONS
@click.option("--plain", is_flag=True, help="One line an event, for logs and CI.")
def resume(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    bus: str,
    fault: tuple[str, ...],
    seed: int,
    sessions: Path | None,
    plain: bool,
) -> None:
    """Go on with the unit's last session, whatever ended it."""
    from triaxcal.cli.rig_live import guide  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    folder = _last_session(sessions or setup.folder / "sessions")
    guide(setup, _source(setup, bus, fault, seed), folder, plain)


def _last_session(root: Path) -> Path:
    from triaxcal.rig.recording import session_folders  # noqa: PLC0415

    there = session_folders(root)
    if not there:
        raise RefusedError(
            str(root), "no session in it", remedy="start one with `triaxcal rig run`"
        )
    return there[-1]


@rig.command()
@_common
@click.argument("log", type=click.Path(path_type=Path))
@click.option(
    "--into",
    type=click.Path(path_type=Path),
    help="Folder that receives the records; the log's own by default.",
)
def replay(unit: str, plan: Path | None, dbc: Path | None, log: Path, into: Path | None) -> None:
    """Make the records of a session again from LOG, with the journal beside it."""
    from triaxcal.rig import recording, store  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    journal = log.with_name(recording.JOURNAL_FILE)
    played = recording.replay(setup, log, journal if journal.exists() else None)
    for event in played.events:
        if event.kind != "trouble":
            click.echo(event.text)
    if played.bad_lines:
        click.echo(f"{played.bad_lines} lines of {log} are no frames", err=True)
    if not played.engine.session.done:
        done = len(played.engine.session.accepted)
        raise RefusedError(
            str(log),
            f"holds {done} accepted dwells of the plan's",
            expected="a whole session",
            remedy="go on with `triaxcal rig resume`",
        )
    files = store.write_records(
        into or log.parent, played.engine.session, setup.dbc.sha256, played.log
    )
    click.echo("written: " + ", ".join(map(str, files)))


@rig.command()
@_common
@_SESSIONS
def status(unit: str, plan: Path | None, dbc: Path | None, sessions: Path | None) -> None:
    """List the sessions of a unit and what they hold."""
    from triaxcal.rig.journal import read_journal  # noqa: PLC0415
    from triaxcal.rig.recording import JOURNAL_FILE, durable_events, session_folders  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    root = sessions or setup.folder / "sessions"
    for folder in session_folders(root):
        found = read_journal(folder / JOURNAL_FILE)
        dwells = [e for e in durable_events(found.records) if e.dwell is not None]
        click.echo(f"{folder}: {len(dwells)} accepted dwells, {len(found.records)} records")
        for event in dwells:
            click.echo(f"  {event.text}")
        if found.damaged or found.torn:
            what = "damaged" if found.damaged else "torn at its end, as a crash leaves it"
            click.echo(f"  journal {what}: only the records above are believed")
    if not session_folders(root):
        click.echo(f"{root}: no session")


@rig.command()
@_common
@_bus_options
@click.option("--seconds", type=click.FloatRange(1.0, 600.0), default=5.0, show_default=True)
def check(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    bus: str,
    fault: tuple[str, ...],
    seed: int,
    seconds: float,
) -> None:
    """Look whether bus, DBC, unit, rate, counters and noise are as they should be."""
    from triaxcal.rig.check import collect, findings  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    source = _source(setup, bus, fault, seed)
    try:
        frames = collect(source, seconds)
        found = findings(setup, frames, source.name, source.notes())
    finally:
        source.close()
    for finding in found:
        click.echo(f"{'good ' if finding.good else 'WRONG'}  {finding.text}")
    wrong = sum(not finding.good for finding in found)
    if wrong:
        raise RefusedError(bus, f"{wrong} of {len(found)} checks failed", remedy="see above")


@rig.command()
@_common
@_bus_options
@click.option("--seconds", type=float, help="Stop after so long; without it, at Ctrl-C.")
@click.argument("log", type=click.Path(path_type=Path))
def record(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    bus: str,
    fault: tuple[str, ...],
    seed: int,
    seconds: float | None,
    log: Path,
) -> None:
    """Append every frame on the bus to LOG, deciding nothing."""
    from triaxcal.rig.rawlog import RawLog  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    source = _source(setup, bus, fault, seed)
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


@rig.command()
@_common
@_bus_options
@click.option("--seconds", type=float, help="Stop after so long; without it, at Ctrl-C.")
@click.option("--hold", type=int, default=130, show_default=True, help="Seconds in each position.")
def simulate(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    bus: str,
    fault: tuple[str, ...],
    seed: int,
    seconds: float | None,
    hold: int,
) -> None:
    """Be a rig on a bus, in real time, turning through the plan's positions."""
    from triaxcal.cli.rig_live import simulate_on  # noqa: PLC0415
    from triaxcal.rig.sources import open_bus  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    name = bus if ":" in bus else f"socketcan:{bus}"
    sender = open_bus(name, setup.plan.layout == "fd")
    simulate_on(sender, _simulated(setup, fault, seed), setup.plan, seconds, hold)


@rig.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
def export(log: Path, target: Path) -> None:
    """Write LOG for other tools: TARGET ends in .asc, .blf, .csv, .mf4 or .parquet."""
    from triaxcal.rig.export import export_log  # noqa: PLC0415

    shows = sys.stderr.isatty()

    def told(count: int) -> None:
        if shows:
            click.echo(f"\r{count} frames ...", err=True, nl=False)

    try:
        count = export_log(log, target, told)
    finally:
        if shows:
            click.echo("\r\x1b[K", err=True, nl=False)
    click.echo(f"{target}: {count} frames")


@rig.command()
@_common
@click.option("--samples", type=click.IntRange(1), default=100_000, show_default=True)
@click.option("--bus", help="CAN device to do it on; without it, a socket between two processes.")
@click.option("--seed", type=int, default=1, show_default=True)
def fil(
    *,
    unit: str,
    plan: Path | None,
    dbc: Path | None,
    samples: int,
    bus: str | None,
    seed: int,
) -> None:
    """Run the generated C as a node and check each answer against Python, bit for bit."""
    from triaxcal.cli.rig_fil import firmware_in_the_loop  # noqa: PLC0415

    setup = _setup(unit, plan, dbc)
    done = firmware_in_the_loop(setup, samples, bus, seed)
    rate = done.samples / done.seconds
    click.echo(f"{done.samples} samples bit for bit, {rate:.0f} a second")
