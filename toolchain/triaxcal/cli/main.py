"""The command line. The only place that prints, reads arguments and exits."""

from __future__ import annotations

import importlib
import itertools
import os
import sys
from pathlib import Path

import click

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import HELP, UnitFolder, WithKinds, example, unit_and_build

SECTIONS = {
    "Begin": ("example", "init", "doctor"),
    "Calibrate": ("calib", "dynamic", "batch"),
    "In the field": ("check", "update", "device"),
    "Look at readings and results": (
        "diagnose",
        "poses",
        "drift",
        "crosscoupling",
        "history",
        "noise",
        "report",
    ),
    "Into production": ("firmware", "image", "a2l", "export", "certificate"),
    "Check the generated C": ("verify", "certify", "target"),
    "Plan, measure, simulate": ("design", "rig", "simulate", "schema"),
}
"""Every command, in the order of the help. Most are imported from files of their own."""


class _Commands(click.Group):
    """A command of its own file is imported when it is asked for: `calib` waits for none."""

    def list_commands(self, _ctx: click.Context) -> list[str]:
        return list(itertools.chain(*SECTIONS.values()))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.commands and cmd_name in self.list_commands(ctx):
            found = getattr(importlib.import_module(f"triaxcal.cli.{cmd_name}"), cmd_name)
            self.add_command(found, cmd_name)
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, names in SECTIONS.items():
            found = {name: self.get_command(ctx, name) for name in names}
            with formatter.section(title):
                formatter.write_dl([(n, c.get_short_help_str(80)) for n, c in found.items() if c])


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=example("triaxcal example AT-SIM", "triaxcal calib AT-SIM", "triaxcal calib --help"),
)
@click.version_option(__version__, prog_name="triaxcal")
def main() -> None:
    """From readings of a triaxial accelerometer to verified fixed-point C.

    UNIT is the folder of a unit, or its name if the folder lies in units/. `triaxcal doctor` names
    the folder of the documentation.
    """


@main.command(
    context_settings=HELP,
    cls=WithKinds,
    epilog=example("triaxcal calib AT-SIM", "triaxcal calib units/AT-SIM --build out"),
)
@unit_and_build
def calib(unit: Path, build: Path) -> None:
    """Calibrate a unit and write its C.

    The folder UNIT has unit.toml and the readings that it names, usually measurements.csv. A unit
    whose unit.toml has a table [dynamic] is an IMU: `triaxcal dynamic` does the same.
    """
    from triaxcal.cli.progress import calibrate  # noqa: PLC0415

    calibrate(unit, build)


@main.command(
    context_settings=HELP,
    epilog=example(
        "triaxcal simulate AT-SIM --seed 7",
        "triaxcal simulate AT-SIM --series 40 --into build/units",
    ),
)
@click.argument("unit", type=UnitFolder())
@click.option("--seed", type=int, help="Replaces the seed of truth.toml or imu_truth.toml.")
@click.option("--series", type=int, help="Write this many units that differ from UNIT instead.")
@click.option("--into", type=click.Path(path_type=Path), help="Folder of the series' units.")
def simulate(unit: Path, seed: int | None, series: int | None, into: Path | None) -> None:
    """Write the readings of a simulated unit.

    The folder UNIT has unit.toml and truth.toml (or tables.toml), and receives measurements.csv. An
    IMU has imu_truth.toml and receives recording.csv.
    """
    import triaxcal  # noqa: PLC0415

    if (series is None) != (into is None):
        raise click.UsageError("--series and --into belong together")
    if series is None or into is None:
        click.echo(f"{triaxcal.simulate(unit, seed)} written")
        return
    folders = triaxcal.simulate_series(unit, into, series, 1 if seed is None else seed)
    with click.progressbar(folders, length=series, label="simulating", file=sys.stderr) as bar:
        written = list(bar)
    click.echo(f"{len(written)} units written: {written[0]} to {written[-1].name}")


def run() -> None:
    """Run the command line; one line and an exit code for whatever a user can cause."""
    try:
        main.main(standalone_mode=False)
    except RefusedError as refusal:
        _leave(f"triaxcal: {refusal}", refusal.exit_code)
    except click.exceptions.Exit as leaving:
        sys.exit(leaving.exit_code)
    except click.ClickException as wrong:
        wrong.show()
        sys.exit(2)
    except click.Abort:
        raise KeyboardInterrupt from None  # click's word for it; `entry` says it
    except BrokenPipeError:
        # The reader of our output went away; what was to be written has been.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        _leave(f"triaxcal: {error.filename or 'output or temporary folder'}: {reason}", 1)
    except Exception as fault:
        # Nothing a user does should come here. One line all the same, with the place for a report.
        import traceback  # noqa: PLC0415  only for this

        frame = traceback.extract_tb(fault.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        _leave(
            f"triaxcal: fault in triaxcal {__version__} at {place}: "
            f"{type(fault).__name__}: {fault}; please report it with the unit's folder",
            1,
        )


def _leave(message: str, code: int) -> None:
    click.echo(message, err=True)
    sys.exit(code)
