"""What the commands of `triaxcal rig` ask for: the session, the bus, where the frames come from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.cli.options import UnitFolder
from triaxcal.rig.sources.source import SOURCES, Wanted, kind_of

if TYPE_CHECKING:
    from triaxcal.rig.many.setup import ManySetup
    from triaxcal.rig.session.engine import Setup
    from triaxcal.rig.sources.source import Source, SourceKind

_DEFAULT_PLAN = "five-temperatures.toml"
_NEEDED = ("can", "cantools", "rich")


def refuse_missing_bench() -> None:
    """Refuse where the bench's packages are missing; `--help` works without them."""
    refuse_missing_packages("triaxcal rig", _NEEDED, "rig")


def _optioned(command: Callable[..., None], *options: Callable[..., Any]) -> Callable[..., None]:
    for option in reversed(options):
        command = option(command)
    return command


_SESSION = (
    click.option("--plan", type=click.Path(path_type=Path), help="TOML file of the session."),
    click.option(
        "--dbc",
        type=click.Path(path_type=Path),
        help="Bus description in place of the one that the rig description names.",
    ),
)
_UNIT_OR_PLAN = click.option(
    "--unit",
    type=UnitFolder(),
    help="Folder, or name in units/; without it, all units that the plan lists.",
)
_SIMULATED = (
    click.option(
        "--fault",
        multiple=True,
        help="Faults of the simulated rig: kind@s[:value[:s]], of one of many units UNIT/kind@s.",
    ),
    click.option("--seed", type=int, default=1, help="Seed of the simulated rig."),
)


def session_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options that say what the session is about; `command` gets them as its `setup`."""

    @wraps(command)
    def with_setup(unit: Path, plan: Path | None, dbc: Path | None, **others: Any) -> None:
        refuse_missing_bench()
        command(setup=_setup(unit, plan, dbc), **others)

    return _optioned(
        with_setup,
        click.option("--unit", required=True, type=UnitFolder(), help="Folder, or name in units/."),
        *_SESSION,
    )


def run_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options of a session of one unit, or of the units that a plan lists.

    `command` gets them as its `setup`, a Setup or a ManySetup, and its `bus`.
    """

    @wraps(command)
    def with_both(  # noqa: PLR0917
        unit: Path | None,
        plan: Path | None,
        dbc: Path | None,
        bus: str | None,
        fault: tuple[str, ...],
        seed: int,
        **others: Any,
    ) -> None:
        refuse_missing_bench()
        setup, name = _one_or_many(unit, plan, dbc, bus)
        command(setup=setup, bus=BusChoice(name, fault, seed), **others)

    return _optioned(
        with_both,
        _UNIT_OR_PLAN,
        *_SESSION,
        click.option("--bus", cls=BusOption),
        *_SIMULATED,
    )


def status_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options of the sessions of one unit, or of the units that a plan lists.

    `command` gets them as its `setup`, a Setup or a ManySetup.
    """

    @wraps(command)
    def with_setup(unit: Path | None, plan: Path | None, dbc: Path | None, **others: Any) -> None:
        refuse_missing_bench()
        # A bus is not opened: any name will do where the plan has none.
        many = _many(unit, plan, dbc, "-")
        command(setup=_setup(_given(unit), plan, dbc) if many is None else many, **others)

    return _optioned(with_setup, _UNIT_OR_PLAN, *_SESSION)


def _many(unit: Path | None, plan: Path | None, dbc: Path | None, bus: str) -> ManySetup | None:
    """Setup of the units that a plan lists; None where one unit is named, or it lists none."""
    from triaxcal.rig.many.setup import many_of_plan  # noqa: PLC0415
    from triaxcal.rig.plan.plan import list_planned  # noqa: PLC0415

    if unit is not None or plan is None or not list_planned(plan):
        return None
    return many_of_plan(plan, bus, dbc)


def _given(unit: Path | None) -> Path:
    if unit is None:
        raise click.UsageError("Missing option '--unit', or a '--plan' that lists units.")
    return unit


def _one_or_many(
    unit: Path | None, plan: Path | None, dbc: Path | None, bus: str | None
) -> tuple[Setup | ManySetup, str]:
    """Setup of a session, and its bus."""
    from triaxcal.rig.plan.plan import list_planned  # noqa: PLC0415

    many = _many(unit, plan, dbc, bus or "")
    if many is not None:
        return many, bus or ""
    unit = _given(unit)
    planned = list_planned(plan) if plan is not None else {}
    known = planned[unit.name].bus if unit.name in planned else None
    if bus is None and known is None:
        raise click.UsageError("Missing option '--bus'.")
    return _setup(unit, plan, dbc), bus or known or ""


@dataclass(frozen=True)
class BusChoice:
    """Where the frames come from; faults and seed are the simulated rig's."""

    name: str
    faults: tuple[str, ...]
    seed: int


class BusOption(click.Option):
    """Explained by the registry of sources."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The kinds of sources."""
        self.help = "; ".join(f"{kind.label}: {kind.doc}" for kind in SOURCES) + "."
        return super().get_help_record(ctx)


def bus_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options of the bus; `command` gets them as its `bus`."""

    @wraps(command)
    def with_bus(bus: str, fault: tuple[str, ...], seed: int, **others: Any) -> None:
        command(bus=BusChoice(bus, fault, seed), **others)

    return _optioned(
        with_bus,
        click.option("--bus", required=True, cls=BusOption),
        *_SIMULATED,
    )


SESSIONS = click.option(
    "--sessions",
    type=click.Path(path_type=Path),
    help="Folder of the unit's sessions; sessions/ in the unit's folder by default.",
)
PLAIN = click.option("--plain", is_flag=True, help="One line an event, for logs and CI.")
UNATTENDED = click.option(
    "--unattended",
    is_flag=True,
    help="Set the chamber and turn the unit by [chamber] and [positioner] of the plan.",
)
SECONDS = click.option("--seconds", type=float, help="Stop after this time; by default at Ctrl-C.")


def _setup(folder: Path, plan: Path | None, dbc: Path | None) -> Setup:
    from triaxcal.base.shipped import shipped  # noqa: PLC0415
    from triaxcal.rig.description.rigfile import read_description  # noqa: PLC0415
    from triaxcal.rig.many.setup import one_of_plan  # noqa: PLC0415
    from triaxcal.rig.plan.plan import list_planned, read_plan  # noqa: PLC0415
    from triaxcal.rig.session.engine import Setup  # noqa: PLC0415
    from triaxcal.unit.description import read_unit  # noqa: PLC0415

    if plan is not None and list_planned(plan):
        return one_of_plan(plan, folder.name, dbc)
    description = read_unit(folder)
    session_plan = read_plan(plan or shipped("rig") / "plans" / _DEFAULT_PLAN, description)
    rig = read_description(session_plan.rig, dbc)
    return Setup(folder, description, session_plan, rig)


def open_source(setup: Setup, bus: BusChoice) -> Source:
    """Frames of the chosen bus.

    Raises
    ------
    RefusedError
        When it cannot be opened, faults are given for a real bus, or the rig's signals cannot
        make a session of the unit.
    """
    kind = kind_of(bus.name)
    if bus.faults and not kind.simulated:
        raise RefusedError("--fault", f"given with --bus {bus.name}", expected="--bus virtual")
    refuse_other_kind(setup, kind)
    rig = setup.rig
    source = kind.open(Wanted(bus.name, rig.fd, lambda: simulated(setup, bus), rig.lines))
    try:
        setup.refuse_unfit()
    except RefusedError:
        source.close()
        raise
    return source


def refuse_other_kind(setup: Setup, kind: SourceKind) -> None:
    """Refuse frames for a rig that sends lines, and the other way round."""
    lines = setup.rig.lines
    if not kind.serves(lines):
        raise RefusedError(
            f"--bus {kind.label}",
            f"gives {kind.speaks}",
            expected=f"what {setup.rig.name} describes: "
            + ", ".join(k.label for k in SOURCES if k.serves(lines)),
        )


def simulated(setup: Setup, bus: BusChoice) -> Any:
    """Rig that does not exist, from the unit's truth.toml."""
    from triaxcal.rig.simulated.simorders import read_fault  # noqa: PLC0415
    from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig  # noqa: PLC0415
    from triaxcal.simulation.truth import TRUTH_FILE, read_truth  # noqa: PLC0415

    if not (setup.folder / TRUTH_FILE).is_file():
        raise RefusedError(
            "--bus virtual",
            f"{setup.folder} has no {TRUTH_FILE}",
            expected="a simulated unit: the rig that does not exist turns one",
            remedy="give the interface of the real rig, as --bus can0, or --unit AT-SIM-BENCH",
        )
    truth, _ = read_truth(setup.folder)
    settings, faults = RigSettings(seed=bus.seed), tuple(map(read_fault, bus.faults))
    return SimulatedRig(setup.unit, truth, setup.plan, setup.rig, settings, faults)
