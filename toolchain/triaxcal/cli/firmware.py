"""`triaxcal firmware`: the C of a calibrated unit, under another prefix."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import ARITHMETIC, DELIVERED, PREFIX, UnitFolder, command, example, say


@command(
    epilog=example(
        "triaxcal firmware AT-SIM --prefix left_accel",
        "triaxcal firmware build/AT-SIM --arithmetic thumb2 --into out",
    )
)
@click.argument("unit", type=UnitFolder(files=True))
@DELIVERED
@PREFIX
@ARITHMETIC
@click.option(
    "--into", type=click.Path(path_type=Path), help="Folder of its own; default: build/UNIT-PREFIX."
)
def firmware(
    unit: Path, build: Path, prefix: str | None, arithmetic: str | None, into: Path | None
) -> None:
    """Write the C of a calibrated unit under another prefix or in another arithmetic.

    UNIT is a unit, whose calibration is in build/UNIT, or a delivered folder. Nothing is fitted:
    the constants are those of the calibration. The C is checked as `calib` checks it, and all files
    are written, or none. Give each sensor of a program its own prefix.
    """
    import triaxcal  # noqa: PLC0415

    made = triaxcal.delivered_firmware(unit, build, prefix, arithmetic)
    vectors = f"{made.check():_}".replace("_", " ")
    target = into or build / f"{made.unit}-{made.prefix}"
    names = ", ".join(path.name for path in made.write(target))
    say(f"{vectors} vectors: Python, reference C and generated C agree")
    say(f"{target}/: {names}")
