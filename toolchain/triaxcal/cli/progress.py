"""Long work with its progress on the screen."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.termui import progressbar

from triaxcal import deliver
from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.cli.options import say

if TYPE_CHECKING:
    from triaxcal import Calibration


def calibrate(unit: Path, build: Path) -> None:
    """Deliver a unit or an IMU, and print what was done."""
    with bar() as progress:
        done = deliver(unit, build, progress)
    say(done.summary)
    for warning in done.warnings:
        click.echo(warning, err=True)


def delivered(unit: Path, build: Path) -> Calibration:
    """The calibration that was delivered for a unit."""
    from triaxcal import load  # noqa: PLC0415
    from triaxcal.unit.folder import find_unit  # noqa: PLC0415

    find_unit(unit)
    path = build / unit.absolute().name / "calibration.json"
    if not path.is_file():
        raise RefusedError(
            str(path),
            "no such file",
            expected="a delivered calibration",
            remedy=f"run `triaxcal calib {unit}` first, or name its folder with --build",
        )
    return load(path)


@contextmanager
def bar() -> Iterator[Progress]:
    """Progress on the screen, by the name of a step and the part of it that is done."""
    with ExitStack() as stack:
        bars: list[Any] = []

        def progress(step: str, part: float) -> None:
            if not bars:  # nothing is drawn for what is refused at the door
                bars.append(
                    stack.enter_context(progressbar(length=1000, label=step, file=sys.stderr))
                )
            drawn = bars[0]
            if drawn.label != step:
                drawn.label = step
                drawn.pos = 0
            drawn.update(max(0, round(1000 * part) - drawn.pos))

        yield progress
