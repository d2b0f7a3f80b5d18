"""triaxcal crosscoupling: an orthogonal pair of accelerometers on a dividing head, P3."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import PICTURE, command, example, show

if TYPE_CHECKING:
    from triaxcal import LivePair

_POLL_S = 0.2
_UNDO = "undo"


@command(
    epilog=example(
        "triaxcal crosscoupling pair.csv --picture pair.svg",
        "triaxcal crosscoupling --live --save pair.csv",
    )
)
@click.argument("file", type=click.Path(path_type=Path), required=False)
@click.option(
    "--gravity",
    type=click.FloatRange(9.7, 9.9),
    default=9.80665,
    show_default=True,
    help="Local gravity, m/s^2.",
)
@click.option(
    "--mounting",
    type=click.Choice(["pendulum", "output"]),
    default="pendulum",
    show_default=True,
    help="Axes in the plane of rotation beside the input axes: pendulum gives Kip, output Kio.",
)
@click.option(
    "--cubic/--no-cubic",
    default=True,
    show_default=True,
    help="Whether the cubes of the accelerations, K3, are fitted.",
)
@click.option("--live", is_flag=True, help="Show the estimate after each position.")
@click.option(
    "--target",
    type=click.FloatRange(0.0, min_open=True),
    help="With --live: enough is this standard deviation of both, g/g^2.",
)
@click.option(
    "--save",
    type=click.Path(path_type=Path, dir_okay=False),
    help="With --live: write the positions to this CSV.",
)
@click.option(
    "--idle",
    type=click.FloatRange(0.0, min_open=True),
    help="With --live FILE: stop after so many seconds without a new line.",
)
@PICTURE
def crosscoupling(file: Path | None, picture: Path | None, **options: Any) -> None:
    """Fit the cross-coupling of a pair of accelerometers.

    FILE is a CSV with columns theta_deg, a_g, b_g and one row for each position of the dividing
    head; sd_a_g, sd_b_g too where the standard deviations are known.

    With --live a row is a line of those numbers, typed or piped in, or appended to FILE while it is
    measured. `undo` takes the last one back; an end of file or Ctrl-C ends.
    """
    import triaxcal  # noqa: PLC0415

    gravity, mounting, cubic = options["gravity"], options["mounting"], options["cubic"]
    if not options["live"]:
        if file is None:
            raise click.UsageError("Missing argument 'FILE', or option '--live'.")
        show(triaxcal.cross_coupling(file, gravity, mounting, cubic=cubic), picture)
        return
    pair = triaxcal.LivePair(gravity, mounting, options["target"], cubic=cubic)
    lines = _typed() if file is None else _appended(file, options["idle"])
    try:
        for line in lines:
            _take(pair, line, options["save"])
    except KeyboardInterrupt:
        click.echo("stopped", err=True)
    click.echo("")
    show(pair.study(), picture)


def _take(pair: LivePair, line: str, save: Path | None) -> None:
    """Take a line; one that is no position is refused, and the next one is read."""
    text = line.split("#", maxsplit=1)[0].strip()
    if not text or text.replace(" ", "").startswith("theta_deg"):
        return
    try:
        if text == _UNDO:
            pair.undo()
            click.echo(pair.summary or "no position left")
        else:
            pair.take(*_numbers(text))
            click.echo(pair.summary)
    except RefusedError as refusal:
        click.echo(str(refusal), err=True)
        return
    if save is not None:
        stated = pair.rows and len(pair.rows[-1]) == 5
        head = "theta_deg,a_g,b_g" + ",sd_a_g,sd_b_g" * bool(stated)
        rows = [",".join(f"{value:.12g}" for value in row) for row in pair.rows]
        save.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def _numbers(text: str) -> list[float]:
    parts = text.replace(",", " ").replace(";", " ").split()
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in {3, 5}:
        raise RefusedError(
            "line", f'"{text}"', expected="theta_deg a_g b_g, or theta_deg a_g b_g sd_a_g sd_b_g"
        )
    return numbers


def _typed() -> Iterator[str]:
    with click.open_file("-") as stream:
        if stream.isatty():
            click.echo("theta_deg a_g b_g, a line for each position; undo; Ctrl-D ends", err=True)
        yield from stream


def _appended(file: Path, idle_s: float | None) -> Iterator[str]:
    """Whole lines of a file, as they are written; the last without its end when it is idle."""
    waited, rest = time.monotonic(), ""
    try:
        with file.open(encoding="utf-8") as stream:
            while True:
                part = stream.readline()
                rest += part
                if rest.endswith("\n"):
                    yield rest
                    waited, rest = time.monotonic(), ""
                elif not part:
                    if idle_s is not None and time.monotonic() - waited > idle_s:
                        break
                    time.sleep(_POLL_S)
    except (OSError, UnicodeDecodeError) as error:
        raise RefusedError(str(file), str(error), expected="a text file") from error
    if rest:
        yield rest
