"""The files that a signature is made with: a private key and its X.509 certificate, both PEM."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from triaxcal.base.errors import RefusedError
from triaxcal.report.dcc.signed import MINUTE

if TYPE_CHECKING:
    from cryptography import x509

_LABEL = re.compile(rb"-----BEGIN ([A-Z0-9 ]+)-----")
_KEY = "a private key in PEM, RSA or EC (P-256, P-384, P-521)"
_NO_KEY = {
    b"OPENSSH PRIVATE KEY": ("a key of SSH", "make one for signatures, with its certificate"),
    b"CERTIFICATE": ("a certificate", "give it with --cert, and its private key with --key"),
    b"CERTIFICATE REQUEST": ("a request for a certificate", "give the private key beside it"),
    b"PUBLIC KEY": ("a public key", "give the private key that belongs to it"),
    b"RSA PUBLIC KEY": ("a public key", "give the private key that belongs to it"),
}
_LONGEST = 200
"""Of a name in a certificate, as it is shown."""
RSA_BITS = 2048
"""Shortest RSA key that is taken."""


@dataclass(frozen=True)
class KeyPair:
    """A private key with the certificates that go into the signature, the signer's first.

    Attributes
    ----------
    key : private key of the package cryptography
    chain : tuple of certificates
    hash_bits : int
        Of the hash that the signature takes.
    """

    key: Any
    chain: tuple[x509.Certificate, ...]
    hash_bits: int

    @property
    def method(self) -> str:
        """Name of the method of signature."""
        kind = "ECDSA" if hasattr(self.key, "curve") else "RSA"
        return f"{kind}_SHA{self.hash_bits}"


def key_pair(
    key: tuple[str, bytes], cert: tuple[str, bytes], passphrase: bytes | None, now: datetime
) -> KeyPair:
    """The key and its certificate, checked against each other.

    Parameters
    ----------
    key, cert : name and content of each file
    passphrase : bytes or None
        Of an encrypted key.
    now : datetime
        With its time zone; the certificate must be valid then.

    Raises
    ------
    RefusedError
        When one is of another kind, the key does not open or match, or the certificate is not
        valid now or not for signatures.
    """
    private = _private_key(*key, passphrase)
    chain = certificates(*cert)
    hash_bits = _hash_bits(key[0], private)
    own = chain[0]
    if _spki(own.public_key()) != _spki(private.public_key()):
        raise RefusedError(
            f"{key[0]} and {cert[0]}",
            f"the key ({_kind(private)}) is not that of the first certificate "
            f"({_kind(own.public_key())}, {printable(own.subject)})",
            expected="a certificate of this key",
        )
    if not own.not_valid_before_utc <= now <= own.not_valid_after_utc:
        raise RefusedError(
            cert[0],
            f"the certificate is valid from {own.not_valid_before_utc:{MINUTE}} to "
            f"{own.not_valid_after_utc:{MINUTE}} UTC",
            expected=f"one that is valid now, {now:{MINUTE}} UTC",
            remedy="renew it",
        )
    _refuse_other_use(cert[0], own)
    return KeyPair(private, chain, hash_bits)


def printable(name: x509.Name) -> str:
    """Name in a certificate; whoever made it may have put codes of a terminal there."""
    text = name.rfc4514_string()
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return shown[:_LONGEST] or "(no name)"


def certificates(name: str, content: bytes) -> tuple[x509.Certificate, ...]:
    """Certificates of a PEM file, in its order.

    Raises
    ------
    RefusedError
        When it has none.
    """
    from cryptography import x509  # noqa: PLC0415  optional

    expected = "an X.509 certificate in PEM (-----BEGIN CERTIFICATE-----)"
    labels = _LABEL.findall(content)
    if b"CERTIFICATE" not in labels:
        found = f"a file with {labels[0].decode()}" if labels else "no PEM"
        raise RefusedError(name, found, expected=expected)
    try:
        return tuple(x509.load_pem_x509_certificates(content))
    except ValueError as error:
        raise RefusedError(name, f"damaged: {error}", expected=expected) from None


def _private_key(name: str, content: bytes, passphrase: bytes | None) -> Any:
    from cryptography.hazmat.primitives import serialization  # noqa: PLC0415  optional

    _refuse_other_kind(name, content)
    encrypted = b"ENCRYPTED" in content
    if encrypted and passphrase is None:
        raise RefusedError(
            name, "encrypted, and no passphrase is given", expected="its passphrase",
            remedy="give a file that begins with it: --passphrase-file, or - for standard input",
        )  # fmt: skip
    if passphrase is not None and not encrypted:
        raise RefusedError(
            name, "not encrypted", expected="a key that the passphrase opens",
            remedy="leave --passphrase-file out",
        )  # fmt: skip
    try:
        return serialization.load_pem_private_key(content, passphrase)
    except Exception as error:  # many kinds, whose texts may speak of the key
        why = "the passphrase does not open it, or it is damaged" if encrypted else "damaged"
        kind = type(error).__name__
        raise RefusedError(name, f"{why} ({kind})", expected=_KEY) from None


def _refuse_other_kind(name: str, content: bytes) -> None:
    """Say what a file is that is no private key in PEM; its content is not shown."""
    labels = _LABEL.findall(content)
    keys = [label for label in labels if label.endswith(b"PRIVATE KEY") and label not in _NO_KEY]
    if keys:
        return
    if labels:
        known = _NO_KEY.get(labels[0], (f"{labels[0].decode().lower()}", "give the private key"))
        raise RefusedError(name, known[0], expected=_KEY, remedy=known[1])
    if content.startswith((b"ssh-", b"ecdsa-sha2")):
        raise RefusedError(name, "a public key of SSH", expected=_KEY)
    if content[:1] == b"\x30":
        raise RefusedError(
            name, "no PEM: DER or PKCS #12", expected=_KEY,
            remedy="openssl pkey -inform DER, or openssl pkcs12 -nodes, makes PEM of it",
        )  # fmt: skip
    raise RefusedError(name, "no PEM" if content else "an empty file", expected=_KEY)


def _hash_bits(name: str, private: Any) -> int:
    """Bits of the hash for a key; refuses those that no signature here is made with."""
    from cryptography.hazmat.primitives.asymmetric import ec, rsa  # noqa: PLC0415  optional

    if isinstance(private, rsa.RSAPrivateKey):
        if private.key_size < RSA_BITS:
            raise RefusedError(
                name, f"RSA of {private.key_size} bits", expected=f"{RSA_BITS} bits or more"
            )
        return 256
    bits = {"secp256r1": 256, "secp384r1": 384, "secp521r1": 512}
    if isinstance(private, ec.EllipticCurvePrivateKey) and private.curve.name in bits:
        return bits[private.curve.name]
    raise RefusedError(name, f"a key of {_kind(private)}", expected=_KEY)


def _kind(key: Any) -> str:
    """Kind of a private or a public key, in words."""
    words = type(key).__name__.removesuffix("PrivateKey").removesuffix("PublicKey")
    words = "EC" if words in ("EllipticCurve", "EC") else words
    size = getattr(getattr(key, "curve", None), "name", None) or getattr(key, "key_size", "")
    return f"{words} {size}".strip()


def _spki(public: Any) -> bytes:
    from cryptography.hazmat.primitives import serialization  # noqa: PLC0415  optional

    found: bytes = public.public_bytes(
        serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    return found


def _refuse_other_use(name: str, cert: x509.Certificate) -> None:
    from cryptography import x509  # noqa: PLC0415  optional

    try:
        usage = cert.extensions.get_extension_for_class(x509.KeyUsage).value
    except x509.ExtensionNotFound:
        return
    if not (usage.digital_signature or usage.content_commitment):
        raise RefusedError(
            name, "its key usage is not for signatures",
            expected="digitalSignature or nonRepudiation among its uses",
        )  # fmt: skip
