"""`triaxcal rig signals`: which signals of a bus description may be the axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import example
from triaxcal.cli.rig_options import refuse_missing_bench

if TYPE_CHECKING:
    from triaxcal.rig.description.survey import Survey, Triad


@click.command(epilog=example("triaxcal rig signals frames.log imu.dbc"))
@click.argument("log", type=click.Path(path_type=Path))
@click.argument("bus_file", type=click.Path(path_type=Path))
@click.option("--most", type=click.IntRange(1), default=5, show_default=True, help="Triads shown.")
def signals(log: Path, bus_file: Path, most: int) -> None:
    """Rank signals that may be x, y and z.

    LOG has frames of the rig at rest, best in several positions. BUS_FILE is a DBC, KCD, SYM or
    ARXML. Three signals are an accelerometer when the length of their vector at rest is g.
    """
    refuse_missing_bench()
    from triaxcal.rig.description.busfile import read_bus_file  # noqa: PLC0415
    from triaxcal.rig.description.survey import survey  # noqa: PLC0415
    from triaxcal.rig.logs.logfile import read_frames  # noqa: PLC0415

    file = read_bus_file(bus_file)
    found = survey(file.layouts(), (part.frames for part in read_frames(log)))
    for warning in file.warnings:
        click.echo(f"note: {warning}", err=True)
    if not found.frames:
        why = "; ".join(found.misfits[:3])
        raise RefusedError(
            str(log),
            f"no frame of a message of {bus_file}" + (f": {why}" if why else ""),
            expected="frames of its IDs, lengths and kinds",
            remedy="is this the bus description of the sensor?",
        )
    _show(found, most)


def _show(found: Survey, most: int) -> None:
    messages = ", ".join(f"{name} {count}" for name, count in found.frames.items())
    click.echo(f"frames: {messages}")
    for place, triad in enumerate(found.triads[:most], start=1):
        click.echo(f"{place}. {', '.join(triad.labels)}: {_said(triad)}")
    if not found.triads:
        click.echo("no three signals of acceleration, of codes, or without a unit")
    for sentence in (*found.misfits, *found.counters, *found.statuses, *found.crcs):
        click.echo(sentence)


def _said(triad: Triad) -> str:
    unit = " g" if triad.in_g else ""
    text = (
        f"|a| = {triad.norm:.4g}{unit} at rest, +- {100 * triad.spread:.2g} %, "
        f"turned by {triad.turned_deg:.0f} deg"
    )
    if not triad.tells:
        return f"{text}: its unit is not known, and it was not turned: this log says nothing"
    return f"{text}: not g, is this the right bus description?" if _wrong(triad) else text


def _wrong(triad: Triad) -> bool:
    """Whether the vector is too long or too short for any accelerometer at rest."""
    return triad.in_g and abs(triad.norm - 1.0) > 0.2
