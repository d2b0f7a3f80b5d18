"""`triaxcal image`: a file of constants: whose it is, and files to flash it with."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.cli.options import HexNumber, command, example, say


@command(
    epilog=example(
        "triaxcal image build/AT-SIM/triax_calib.bin",
        "triaxcal image triax_calib.bin --to AT-SIM.hex --address 0x0803F000",
        "triaxcal image triax_calib.bin --to AT-SIM.bin --size 2048",
    )
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--to",
    type=click.Path(path_type=Path),
    help="Write this file: .hex (Intel HEX), .srec, .uf2, or .bin (padded with 0xFF).",
)
@click.option("--address", type=HexNumber(), help="Address of its first byte in flash.")
@click.option("--size", type=HexNumber(), help="Bytes of flash that are reserved for it.")
@click.option("--family", type=HexNumber(), help="Family of the board, for UF2.")
def image(
    file: Path, to: Path | None, address: int | None, size: int | None, family: int | None
) -> None:
    """Show whose constants a file holds, or write it for production.

    FILE is a triax_calib.bin, or the triax_imu.bin of an IMU. Without --to it is checked and shown.
    Numbers are decimal, or hexadecimal with 0x.
    """
    import triaxcal  # noqa: PLC0415

    if to is None and (address, size, family) != (None, None, None):
        raise click.UsageError("--address, --size and --family belong to --to")
    found = triaxcal.read_image(file)
    say(found.summary)
    if to is not None:
        say(f"{found.write(to, address, size=size, family=family)} written")
