"""triaxcal export: a delivery for a build system or an autopilot."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import ARITHMETIC, DELIVERED, HELP, PREFIX, UnitFolder, example


class _WithTargets(click.Command):
    """The help lists what there is."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from triaxcal.exports.registry import TARGETS  # noqa: PLC0415

        super().format_options(ctx, formatter)
        with formatter.section("Targets, --to"):
            formatter.write_dl([(t.name, t.doc) for t in TARGETS])


@click.command(
    context_settings=HELP,
    cls=_WithTargets,
    epilog=example(
        "triaxcal export AT-SIM --to cmake",
        "triaxcal export AT-SIM --to cmake --prefix left_accel",
        "triaxcal export AT-SIM --to px4 --into out",
    ),
)
@click.argument("unit", type=UnitFolder(files=True))
@DELIVERED
@click.option("--to", required=True, help="What to write, below.")
@PREFIX
@ARITHMETIC
@click.option(
    "--into",
    type=click.Path(path_type=Path),
    help="Folder; default: build/UNIT-TO, with a prefix build/UNIT-PREFIX-TO.",
)
def export(
    unit: Path,
    build: Path,
    to: str,
    prefix: str | None,
    *,
    arithmetic: str | None,
    into: Path | None,
) -> None:
    """Write a delivered unit for a build system or an autopilot.

    UNIT is a unit, whose delivery is build/UNIT, or a delivered folder. A build system gets the C
    that was checked, byte for byte; under another prefix
    or in another arithmetic it is made and checked again. An autopilot
    gets the parameters of its own, simpler model, and what that costs at readings of this unit.
    """
    import triaxcal  # noqa: PLC0415

    made = triaxcal.export(unit, to, into, build, prefix, arithmetic=arithmetic)
    click.echo(made.summary)
    click.echo(f"\n{len(made.files)} files in {made.folder}/")
