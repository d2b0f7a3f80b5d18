"""`triaxcal certificate`: a Digital Calibration Certificate checked, signed, verified."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import BinaryIO

import click

from triaxcal.cli.options import HELP, example, say

SCHEMAS = "TRIAXCAL_DCC_SCHEMAS"
_FILE = click.argument("file", type=click.Path(path_type=Path))


@click.group(
    context_settings=HELP,
    epilog=example(
        "triaxcal certificate check certificate.dcc.xml --schemas schemas",
        "triaxcal certificate sign --help",
    ),
)
def certificate() -> None:
    """Check, sign and verify a Digital Calibration Certificate.

    `triaxcal calib` writes certificate.dcc.xml for a unit with [certificate] in unit.toml.
    """


@certificate.command(
    context_settings=HELP,
    epilog=example("triaxcal certificate check certificate.dcc.xml --schemas schemas"),
)
@_FILE
@click.option(
    "--schemas",
    type=click.Path(path_type=Path),
    required=True,
    envvar=SCHEMAS,
    show_envvar=True,
    help="Folder with dcc.xsd 3.2.1, SI_Format.xsd and xmldsig-core-schema.xsd.",
)
def check(file: Path, schemas: Path) -> None:
    """Check a certificate against the schema of PTB.

    The schema files are PTB's and W3C's and no part of triaxcal. Nothing is taken from the network.
    The exit code is 1 when the certificate is not valid.
    """
    import triaxcal  # noqa: PLC0415

    faults = triaxcal.check_certificate(file, schemas)
    say("\n".join(faults) or f"{file}: valid by dcc.xsd 3.2.1 in {schemas}")
    sys.exit(bool(faults))


@certificate.command(
    context_settings=HELP,
    epilog=example("triaxcal certificate sign certificate.dcc.xml --key k.pem --cert c.pem"),
)
@_FILE
@click.option(
    "--key", required=True, type=click.Path(path_type=Path), help="Private key, RSA or EC, PEM."
)
@click.option(
    "--cert",
    required=True,
    type=click.Path(path_type=Path),
    help="Its X.509 certificate, PEM; those of its authorities may follow in it.",
)
@click.option(
    "--passphrase-file",
    type=click.File("rb"),
    help="Its first line opens an encrypted key; - is standard input.",
)
@click.option(
    "--to",
    type=click.Path(path_type=Path),
    help="Write this file; default: a name with .signed, beside a delivered folder.",
)
def sign(
    file: Path, *, key: Path, cert: Path, passphrase_file: BinaryIO | None, to: Path | None
) -> None:
    """Sign a certificate with your key.

    The signature is XAdES, enveloped: it stands at the end of a copy of the file, which stays valid
    by the schema.
    """
    import triaxcal  # noqa: PLC0415

    secret = None
    if passphrase_file is not None:
        line = passphrase_file.readline().rstrip(b"\r\n")
        secret = line.decode("utf-8", "surrogateescape")  # it need not be text
    path = triaxcal.sign_certificate(file, key, cert, passphrase=secret, to=to)
    say(f"{path} written")


@certificate.command(
    context_settings=HELP,
    epilog=example("triaxcal certificate verify AT-SIM.certificate.signed.dcc.xml --ca lab.pem"),
)
@_FILE
@click.option(
    "--ca",
    type=click.Path(path_type=Path),
    help="Certificates that you trust, PEM: the signer's, or those of authorities.",
)
def verify(file: Path, ca: Path | None) -> None:
    """Verify the signature of a certificate.

    Says who signed and when, what this shows, and what it does not. The exit code is 1 when the
    signature is not valid.
    """
    import triaxcal  # noqa: PLC0415

    say(str(triaxcal.verify_certificate(file, ca)))
