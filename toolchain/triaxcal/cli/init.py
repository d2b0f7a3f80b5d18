"""`triaxcal init`: a first, commented file of a unit, a session, or a simulation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

import triaxcal
from triaxcal.base.errors import UsageError
from triaxcal.base.extras import quoted
from triaxcal.cli.options import command, example
from triaxcal.keytable.catalogue import FILES

if TYPE_CHECKING:
    from triaxcal.rig.description.busfile import BusFile

_NEXT = {
    "tilter": "write a row for each dwell to measurements.csv beside it, below the line\n"
    "  position,temp_degc,ux_v,uy_v,uz_v\n"
    "as docs/how-to/add-a-unit.md says. Then:\n"
    "  triaxcal calib {0}",
    "recording": "put the recording beside it, as docs/how-to/recordings.md says. Then:\n"
    "  triaxcal poses {0}\n"
    "  triaxcal calib {0}",
    "imu": "put the recording beside it, as docs/how-to/imu.md says. Then:\n  triaxcal calib {0}",
    "truth": "triaxcal simulate {0}",
    "imu-truth": "triaxcal simulate {0}",
}
"""What comes after the first file of a kind."""


@command(
    epilog=example(
        "triaxcal init units/SN-0042",
        "triaxcal init units/IMU-7 --kind imu",
        "triaxcal init my-rig --rig imu.dbc --x IMU.AccX --y IMU.AccY --z IMU.AccZ",
    )
)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--kind",
    type=click.Choice(tuple(FILES)),
    default="tilter",
    show_default=True,
    metavar="KIND",
    help="What the file describes: " + ", ".join(FILES) + ".",
)
@click.option(
    "--rig",
    "bus_file",
    type=click.Path(path_type=Path),
    help="Write rig.toml from a bus description: DBC, KCD, SYM, ARXML.",
)
@click.option("--x", help="With --rig: the signal of x, as Message.Signal; asked for otherwise.")
@click.option("--y", help="The same of y.")
@click.option("--z", help="The same of z.")
@click.option("--temperature", help="The same of the temperature.")
def init(  # noqa: PLR0917
    folder: Path,
    kind: str,
    bus_file: Path | None,
    x: str | None,
    y: str | None,
    z: str | None,
    temperature: str | None,
) -> None:
    """Write a first, commented file of a unit.

    It goes into FOLDER, and beside it a JSON Schema with which editors complete and check it.
    Required keys stand there with an example. The others are commented out, with their defaults.
    No file is overwritten.
    """
    signals = {"x": x, "y": y, "z": z, "temperature": temperature}
    if bus_file is not None:
        _rig(folder, bus_file, signals)
        return
    given = next((name for name, signal in signals.items() if signal is not None), None)
    if given:
        raise UsageError(f"--{given}", "given without --rig", expected="--rig FILE.dbc")
    path, schema = triaxcal.write_first_file(folder, kind)
    click.echo(f"{path} written; replace its examples. {schema.name} is for your editor.")
    if kind in _NEXT:
        click.echo(f"Next: {_NEXT[kind].format(quoted(str(folder)))}")


def _rig(folder: Path, bus_file: Path, signals: dict[str, str | None]) -> None:
    """Write a rig description."""
    from triaxcal.cli.rig_options import refuse_missing_bench  # noqa: PLC0415

    refuse_missing_bench()
    from triaxcal.rig.description.busfile import read_bus_file  # noqa: PLC0415
    from triaxcal.rig.description.firstrig import chosen, write_rig  # noqa: PLC0415

    file = read_bus_file(bus_file)
    for warning in file.warnings:
        click.echo(f"note: {warning}", err=True)
    ask = (lambda key, guess: _asked(file, key, guess)) if at_a_terminal() else None
    found = chosen(file, signals, ask)
    path = write_rig(folder, bus_file, found)
    click.echo(f"{path} written; look through its commented keys. Name it in a plan: [rig] rig.")


def at_a_terminal() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _asked(file: BusFile, key: str, guess: str) -> str:
    """Name of a signal, asked for until there is one of it; the temperature may be left out."""
    from triaxcal.rig.description.buslookup import nearest  # noqa: PLC0415
    from triaxcal.rig.description.firstrig import names_of  # noqa: PLC0415

    known = names_of(file)
    if guess == "" and key == "x":
        click.echo("signals: " + ", ".join(known[:100]))
    while True:
        name = str(click.prompt(key, default=guess, show_default=bool(guess)))
        if name in known or (not name and key == "temperature"):
            return name
        click.echo(f"no signal {name}; nearest: {', '.join(nearest(name, known))}")
