"""What tests of Digital Calibration Certificates share: the schema, keys and certificates."""

from __future__ import annotations

import datetime
import os
from pathlib import Path
from typing import Any

import pytest

from recordings import FOLDER
from triaxcal.cli.certificate import SCHEMAS
from triaxcal.report.dcc.schema import SCHEMA_FILES, schema_faults


def schemas() -> Path:
    """Folder with PTB's schema files; skips the test where they or lxml are absent."""
    pytest.importorskip("lxml")
    folder = Path(os.environ.get(SCHEMAS, FOLDER / "dcc_schema"))
    if not all((folder / name).is_file() for name in SCHEMA_FILES):
        pytest.skip(f"no schema of PTB in {folder} ({SCHEMAS} names another folder)")
    return folder


def faults(content: bytes) -> tuple[str, ...]:
    """What in a certificate breaks the schema."""
    return schema_faults(content, schemas(), "certificate")


NOW = datetime.datetime.now(datetime.UTC)
DAY = datetime.timedelta(days=1)


def key_of(kind: str) -> Any:
    """A private key: "rsa", "ec", "p521", "k1", "ed25519", "short"."""
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa

    return {
        "rsa": lambda: rsa.generate_private_key(65537, 2048),
        "short": lambda: rsa.generate_private_key(65537, 1024),
        "ec": lambda: ec.generate_private_key(ec.SECP256R1()),
        "p521": lambda: ec.generate_private_key(ec.SECP521R1()),
        "k1": lambda: ec.generate_private_key(ec.SECP256K1()),
        "ed25519": ed25519.Ed25519PrivateKey.generate,
    }[kind]()


def pem(key: Any, passphrase: bytes | None = None) -> bytes:
    """A private key in PEM."""
    from cryptography.hazmat.primitives import serialization as s

    how = s.BestAvailableEncryption(passphrase) if passphrase else s.NoEncryption()
    found: bytes = key.private_bytes(s.Encoding.PEM, s.PrivateFormat.PKCS8, how)
    return found


def public_pem(key: Any) -> bytes:
    """Its public key in PEM."""
    from cryptography.hazmat.primitives import serialization as s

    form = s.PublicFormat.SubjectPublicKeyInfo
    found: bytes = key.public_key().public_bytes(s.Encoding.PEM, form)
    return found


def ssh(key: Any) -> tuple[bytes, bytes]:
    """Private and public key as OpenSSH has them."""
    from cryptography.hazmat.primitives import serialization as s

    private = key.private_bytes(s.Encoding.PEM, s.PrivateFormat.OpenSSH, s.NoEncryption())
    return private, key.public_key().public_bytes(s.Encoding.OpenSSH, s.PublicFormat.OpenSSH)


def cert_of(
    key: Any,
    name: str = "N. N.",
    *,
    issuer: tuple[Any, Any] | None = None,
    days: tuple[float, float] = (-1.0, 30.0),
    ca: bool = False,
    signs: bool = True,
) -> Any:
    """Certificate of a key, by itself or by (certificate, key) of an authority.

    `days` are its first and last, from now; `signs` is whether its key usage is for signatures.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.x509.oid import NameOID

    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    by, with_key = (subject, key) if issuer is None else (issuer[0].subject, issuer[1])
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(by)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(NOW + days[0] * DAY)
        .not_valid_after(NOW + days[1] * DAY)
        .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(with_key.public_key()),
            critical=False,
        )
        .add_extension(
            x509.KeyUsage(
                digital_signature=signs and not ca,
                content_commitment=False,
                key_encipherment=not signs,
                data_encipherment=False,
                key_agreement=False,
                key_cert_sign=ca,
                crl_sign=ca,
                encipher_only=False,
                decipher_only=False,
            ),
            critical=True,
        )
    )
    return builder.sign(with_key, hashes.SHA256())


def cert_pem(*certs: Any) -> bytes:
    """Certificates in PEM, one after the other."""
    from cryptography.hazmat.primitives import serialization as s

    return b"".join(c.public_bytes(s.Encoding.PEM) for c in certs)
