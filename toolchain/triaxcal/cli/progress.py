"""Long work with its progress on the screen."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import click
from click.termui import progressbar

from triaxcal import deliver
from triaxcal.base.progress import Progress
from triaxcal.cli.options import say


def calibrate(unit: Path, build: Path) -> None:
    """Deliver a unit or an IMU, and print what was done."""
    with bar() as progress:
        done = deliver(unit, build, progress)
    say(done.summary)
    for warning in done.warnings:
        click.echo(warning, err=True)


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
