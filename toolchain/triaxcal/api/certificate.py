"""Digital Calibration Certificates: against the schema, signed, and their signatures verified."""

from __future__ import annotations

from pathlib import Path

from triaxcal.base.errors import RefusedError, UsageError, refused_by_system
from triaxcal.base.publish import renew
from triaxcal.report.dcc.schema import SCHEMA_FILES, schema_faults
from triaxcal.report.dcc.signature import sign, verify
from triaxcal.report.dcc.signed import Signature

_DELIVERED = "calibration.json"


def check_certificate(path: str | Path, schemas: str | Path) -> tuple[str, ...]:
    """What in a certificate breaks PTB's schema, with its line; nothing where it is valid.

    Parameters
    ----------
    path : path
        The certificate, signed or not.
    schemas : path
        Folder with dcc.xsd 3.2.1, SI_Format.xsd 2.1.0 and xmldsig-core-schema.xsd; nothing is
        taken from the network.

    Raises
    ------
    RefusedError
        When the file is no certificate, a schema file is missing, or lxml is.
    """
    folder = Path(schemas)
    if not folder.is_dir():
        raise UsageError(
            str(folder), "no such folder", expected=f"one with {', '.join(SCHEMA_FILES)}",
            remedy="nothing was checked",
        )  # fmt: skip
    return schema_faults(_content(path), folder, str(path))


def sign_certificate(
    path: str | Path,
    key: str | Path,
    cert: str | Path,
    *,
    passphrase: str | None = None,
    to: str | Path | None = None,
) -> Path:
    """Sign a certificate with a key of one's own (XAdES, enveloped); the file itself stays.

    Parameters
    ----------
    path : path
        The certificate.
    key, cert : path
        PEM files: the private key, RSA or EC, and its X.509 certificate. Certificates up to the
        authority's may follow in the same file.
    passphrase : str or None
        Of an encrypted key.
    to : path or None
        File to write. None is the certificate's name with ".signed" in it; of a delivered folder
        beside it, because a later calibration replaces the folder.

    Returns
    -------
    Path
        The signed certificate.

    Raises
    ------
    RefusedError
        When the file is no certificate or is signed, key or certificate do not serve, the file to
        write exists, or a package is missing.
    """
    source, content = Path(path), _content(path)
    target = _signed_name(source) if to is None else Path(to)
    if target.exists():
        raise RefusedError(
            str(target), "exists already", remedy="move it away, or name another file"
        )
    secret = None if passphrase is None else passphrase.encode("utf-8", "surrogateescape")
    files = [(str(name), _content(name)) for name in (key, cert)]
    signed = sign(content, str(source), files[0], files[1], secret)
    if not target.parent.is_dir():
        raise RefusedError(str(target.parent), "no such folder")
    renew({target.name: signed}, target.parent)
    return target


def verify_certificate(path: str | Path, ca: str | Path | None = None) -> Signature:
    """Verify the signature of a certificate.

    Parameters
    ----------
    path : path
        The certificate.
    ca : path or None
        PEM file with certificates that are trusted: the signer's own, or those of authorities.
        Without it nothing shows who holds the key.

    Returns
    -------
    Signature
        Who signed, when, and in words what this shows and what it does not.

    Raises
    ------
    RefusedError
        When the signature is not valid, or not one; no certificate in `ca` vouches for it; or a
        package is missing.
    """
    trusted = None if ca is None else (str(ca), _content(ca))
    return verify(_content(path), str(path), trusted)


def _signed_name(source: Path) -> Path:
    name = source.name.removesuffix(".xml").removesuffix(".dcc") + ".signed.dcc.xml"
    folder = source.absolute().parent
    if (folder / _DELIVERED).exists():
        return folder.with_name(f"{folder.name}.{name}")
    return source.with_name(name)


def _content(path: str | Path) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise refused_by_system(path, "read", error) from error
