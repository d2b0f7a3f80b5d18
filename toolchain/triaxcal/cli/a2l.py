"""`triaxcal a2l`: the constants in a linked program, for calibration tools."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import DELIVERED, PREFIX, HexNumber, UnitFolder, command, example, say


@command(
    epilog=example(
        "triaxcal a2l AT-SIM --elf firmware.elf",
        "triaxcal a2l AT-SIM --elf firmware.elf --can-ids 0x555 0x666",
        "triaxcal a2l AT-SIM --elf firmware.elf --variable calib",
    )
)
@click.argument("unit", type=UnitFolder(files=True))
@DELIVERED
@click.option(
    "--elf",
    required=True,
    type=click.Path(path_type=Path),
    help="The program as the linker wrote it, with its symbols.",
)
@click.option(
    "--to",
    type=click.Path(path_type=Path),
    help="Write this file; default: triax_calib.a2l beside the program.",
)
@PREFIX
@click.option(
    "--variable",
    "variables",
    multiple=True,
    help="Variable that the program loads an image into, in place of its linked constants; of an "
    "IMU twice, accelerometer first.",
)
@click.option(
    "--can-ids",
    type=(HexNumber(), HexNumber()),
    metavar="COMMANDS ANSWERS",
    help="CAN identifiers of the XCP commands and of the answers, 29-bit ones with bit 31 set.",
)
@click.option("--bitrate", type=int, help="Bit rate of the bus, bit/s.")
def a2l(
    unit: Path,
    build: Path,
    *,
    elf: Path,
    to: Path | None,
    prefix: str | None,
    variables: tuple[str, ...],
    can_ids: tuple[int, int] | None,
    bitrate: int | None,
) -> None:
    """Write the A2L of the constants in a linked program.

    UNIT is a unit or an IMU, whose calibration is in build/UNIT, or a delivered folder. Constants
    that are linked into the program must be those of the unit. Addresses and byte order are the
    program's.
    """
    import triaxcal  # noqa: PLC0415

    made = triaxcal.delivered_firmware(unit, build, prefix)
    path = made.write_a2l(elf, to, variables=variables, can_ids=can_ids, bitrate=bitrate)
    say(f"{path} written")
