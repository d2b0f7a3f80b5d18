"""`triaxcal rig imu`: record an IMU, guided."""

from __future__ import annotations

import contextlib
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import quoted
from triaxcal.cli.options import UnitFolder, example
from triaxcal.cli.rig_options import PLAIN, BusOption, refuse_missing_bench
from triaxcal.unit.folder import UNIT_FILE, check_unit_name

if TYPE_CHECKING:
    from triaxcal.guide.firstunit import Place
    from triaxcal.guide.session import GuidedRecording
    from triaxcal.rig.bus.frames import Frames
    from triaxcal.rig.description.description import RigDescription
    from triaxcal.rig.simulated.simulator import SimulatedRig
    from triaxcal.rig.sources.source import Source

_REFRESH_S = 0.25


@click.command(
    epilog=example(
        "triaxcal rig imu IMU-7 --bus can0 --rig can-imu --latitude 50 --gravity 9.81",
        "triaxcal rig imu IMU-7 --bus can0",
        "triaxcal rig imu IMU-7 --bus replay:drive.blf --plain",
    )
)
@click.argument("unit", type=UnitFolder())
@click.option("--bus", required=True, cls=BusOption)
@click.option("--rig", "rig_file", help="Rig description with gyros, for a unit without unit.toml.")
@click.option(
    "--latitude",
    type=click.FloatRange(-90.0, 90.0),
    help="Of the place, deg, for a unit without unit.toml.",
)
@click.option(
    "--gravity",
    type=click.FloatRange(9.7, 9.9),
    help="At the place, m/s^2, for a unit without unit.toml.",
)
@click.option("--seconds", type=float, help="Stop after this time; by default at Ctrl-C.")
@PLAIN
def imu(  # noqa: PLR0917
    unit: Path,
    bus: str,
    rig_file: str | None,
    latitude: float | None,
    gravity: float | None,
    seconds: float | None,
    plain: bool,
) -> None:
    """Record an IMU by hand or on a table, guided.

    It says what to turn next and how long to hold still. It ends when a calibration of the
    recording meets the standard deviations that [limits] of unit.toml demands. The log goes into
    the folder UNIT. Where that has no unit.toml, one is written.
    """
    refuse_missing_bench()
    from triaxcal.guide.firstunit import copy_description  # noqa: PLC0415
    from triaxcal.guide.session import GuidedRecording, at_once, recorded_rig  # noqa: PLC0415
    from triaxcal.rig.sources.source import Wanted, kind_of  # noqa: PLC0415

    first = _first(unit, rig_file, latitude, gravity)
    kind = kind_of(bus)
    if kind.simulated:
        raise RefusedError("--bus virtual", "simulates no IMU", expected="a bus, or replay:LOG")
    from_log = kind.name == "replay"
    rig = recorded_rig(unit) if first is None else first.rig
    with contextlib.ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(1))
        wanted = Wanted(bus, rig.fd, _no_rig, rig.lines)
        source = stack.enter_context(contextlib.closing(kind.open(wanted)))
        begun = _read(source)
        if first is not None:  # What can be refused has been: nothing is left half-written.
            copy_description(first.rig_file, unit)
        place = None if first is None else first.place
        taken = GuidedRecording(unit, place, bus, at_once if from_log else pool.submit)
        stack.enter_context(contextlib.closing(taken))
        show = _Plain() if plain else stack.enter_context(_Screen())
        _run(taken, source, begun, seconds, from_log, show)
        taken.finish()
    _say_end(unit, taken)


def _no_rig() -> SimulatedRig:
    """A source that simulates was refused before."""
    raise AssertionError


@dataclass(frozen=True)
class _First:
    """A unit without unit.toml: its place, and its rig description where that lies now."""

    place: Place
    rig_file: Path
    rig: RigDescription


def _first(
    unit: Path, rig_file: str | None, latitude: float | None, gravity: float | None
) -> _First | None:
    """What a first unit.toml is written from; None of a unit that has one."""
    from triaxcal.guide.firstunit import Place, refuse_files_elsewhere  # noqa: PLC0415
    from triaxcal.guide.stream import ImuStream  # noqa: PLC0415
    from triaxcal.rig.description.rigfile import read_description  # noqa: PLC0415
    from triaxcal.rig.description.shippedrigs import find_description  # noqa: PLC0415

    given = {"--rig": rig_file, "--latitude": latitude, "--gravity": gravity}
    if (unit / UNIT_FILE).is_file():
        named = next((name for name, value in given.items() if value is not None), None)
        if named is not None:
            raise RefusedError(
                named,
                f"given, and {unit / UNIT_FILE} is there",
                expected="what that file says",
                remedy=f"omit {named}; or correct or remove the file",
            )
        return None
    missing = next((name for name, value in given.items() if value is None), None)
    if missing is not None:
        raise RefusedError(
            str(unit / UNIT_FILE),
            "no such file",
            expected=f"{missing}, from which it is written, or the file",
        )
    assert rig_file is not None
    assert latitude is not None
    assert gravity is not None
    check_unit_name(unit.absolute().name)
    file = find_description(rig_file)
    refuse_files_elsewhere(file, unit)
    rig = read_description(file)
    ImuStream(rig)
    return _First(Place(latitude, gravity), file, rig)


def _read(source: Source) -> Frames | None:
    """The next frames; None at the end of a log."""
    from triaxcal.rig.sources.source import LogEndedError  # noqa: PLC0415

    try:
        return source.read()
    except LogEndedError:
        return None


def _run(  # noqa: PLR0917
    taken: GuidedRecording,
    source: Source,
    frames: Frames | None,
    seconds: float | None,
    from_log: bool,
    show: _Plain,
) -> None:
    """Record until the demands are met, the time is over, the log has ended, or Ctrl-C."""
    end = time.monotonic() + (seconds or float("inf"))
    with contextlib.suppress(KeyboardInterrupt):
        while frames is not None and time.monotonic() < end:
            for _ in taken.feed(frames):
                show.show(taken)
            taken.log.flush()
            for note in source.notes():
                show.note(note)
            done = taken.guide is not None and taken.guide.done is not None
            if done and not from_log:
                return
            frames = _read(source)


class _Plain:
    """One line a change, for logs and CI."""

    def __init__(self) -> None:
        self._last = ""

    def note(self, text: str) -> None:
        """Say something once."""
        click.echo(text, err=True)

    def show(self, taken: GuidedRecording) -> None:
        """Say what has changed."""
        from triaxcal.guide.screen import status_line  # noqa: PLC0415

        guide = taken.guide
        line = _waiting_words(taken) if guide is None else status_line(guide)
        for note in [] if guide is None else guide.notes:
            self.note(f"{taken.seconds:.0f} s: {note}")
        if guide is not None:
            guide.notes.clear()
        if line != self._last:
            click.echo(f"{taken.seconds:.0f} s: {line}")
            self._last = line


class _Screen(_Plain):
    """The whole screen, drawn again and again."""

    def __init__(self) -> None:
        super().__init__()
        from rich.live import Live  # noqa: PLC0415

        self._live = Live(auto_refresh=False, screen=False)
        self._drawn = 0.0
        self._notes: list[str] = []

    def __enter__(self) -> _Screen:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def note(self, text: str) -> None:
        """Show the last three below."""
        self._notes = [*self._notes, text][-3:]

    def show(self, taken: GuidedRecording) -> None:
        """Draw the screen, four times a second."""
        from rich.text import Text  # noqa: PLC0415

        from triaxcal.guide.screen import WIDTH, screen_lines  # noqa: PLC0415

        guide = taken.guide
        if guide is not None:
            self._notes = [*self._notes, *guide.notes][-3:]
            guide.notes.clear()
        ended = guide is not None and guide.done is not None
        if time.monotonic() - self._drawn < _REFRESH_S and not ended:
            return
        self._drawn = time.monotonic()
        lines = (
            [_waiting_words(taken)]
            if guide is None
            else screen_lines(guide, taken.unit.name, taken.seconds)
        )
        notes = [note[:WIDTH] for note in self._notes]
        self._live.update(Text("\n".join([*lines, "", *notes, "Ctrl-C: stop"])), refresh=True)


def _waiting_words(taken: GuidedRecording) -> str:
    if taken.stream.rate_hz is None:
        return "waiting for samples"
    return "put it down, any side up; hold it still for 10 s"


def _say_end(unit: Path, taken: GuidedRecording) -> None:
    stream, guide = taken.stream, taken.guide
    lost = f", {stream.lost} lost" if stream.lost else ""
    bad = f", {stream.bad} with a bad status" if stream.bad else ""
    click.echo(f"{taken.log.path}: {taken.log.lines} frames, {stream.count} samples{lost}{bad}")
    if guide is not None and guide.done is not None:
        click.echo("every demand of [limits] is met by a calibration of this recording")
    click.echo(f"Next: triaxcal dynamic {quoted(str(unit))}")
