"""The signature of a certificate: XAdES, enveloped, with the user's key; and its verification.

ETSI EN 319 132-1 (XAdES), W3C XML Signature. signxml does the work; what the user gives, and that
the signature covers the whole certificate, is checked here.
"""

from __future__ import annotations

import base64
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.report.dcc.keyfile import certificates, key_pair, printable
from triaxcal.report.dcc.schema import EXTRA, parsed
from triaxcal.report.dcc.signed import MINUTE, Signature

if TYPE_CHECKING:
    from cryptography import x509
    from lxml import etree

_DS = "{http://www.w3.org/2000/09/xmldsig#}"
_XADES = "{http://uri.etsi.org/01903/v1.3.2#}"
_PROPERTIES = f"{_XADES}SignedProperties"
_NEEDED = ("lxml", "signxml", "cryptography")
_FEWEST = 2
"""References of XAdES: the document and the signed properties; we refer to the key besides."""


def sign(
    content: bytes,
    where: str,
    key: tuple[str, bytes],
    cert: tuple[str, bytes],
    passphrase: bytes | None = None,
) -> bytes:
    """The certificate with a signature as its last element.

    Parameters
    ----------
    content, where
        The certificate and its name.
    key, cert : name and content of each file, PEM
        `cert` may have further certificates, up to the authority's.
    passphrase : bytes or None
        Of an encrypted key.

    Raises
    ------
    RefusedError
        When the file is no certificate or is signed, key or certificate do not serve, or a package
        is missing.
    """
    refuse_missing_packages(where, _NEEDED, EXTRA)
    from lxml import etree  # noqa: PLC0415  optional
    from signxml import DigestAlgorithm, SignatureMethod  # noqa: PLC0415
    from signxml.xades import XAdESDataObjectFormat, XAdESSigner  # noqa: PLC0415

    root = parsed(content, where)
    if _signatures(root):
        raise RefusedError(
            where, "is signed already", expected="a certificate without a signature",
            remedy="sign the file as triaxcal calib wrote it",
        )  # fmt: skip
    _refuse_comments(root, where)
    pair = key_pair(key, cert, passphrase, datetime.now(UTC))
    signer = XAdESSigner(
        signature_algorithm=SignatureMethod[pair.method],
        digest_algorithm=DigestAlgorithm[f"SHA{pair.hash_bits}"],
        data_object_format=XAdESDataObjectFormat("Digital Calibration Certificate", "text/xml"),
    )
    made = signer.sign(root, key=pair.key, cert=list(pair.chain))
    signed: bytes = etree.tostring(made, xml_declaration=True, encoding="UTF-8") + b"\n"
    verify(signed, f"{where}, signed")
    return signed


def verify(content: bytes, where: str, ca: tuple[str, bytes] | None = None) -> Signature:
    """The signature of a certificate.

    Parameters
    ----------
    content, where
        The certificate and its name.
    ca : name and content of a PEM file, or None
        Certificates that the user trusts: the signer's own, or those of authorities.

    Raises
    ------
    RefusedError
        When there is no signature or another number of them, the file was changed after it was
        signed, the certificate was not valid then, or no certificate of `ca` vouches for it.
    """
    refuse_missing_packages(where, _NEEDED, EXTRA)
    root = parsed(content, where)
    found = _signatures(root)
    if len(found) != 1 or found[0].getparent() is not root:
        said = {0: "is not signed", 1: "has its signature inside another element"}
        raise RefusedError(
            where, said.get(len(found), f"has {len(found)} signatures"),
            expected="one signature, of the whole certificate",
        )  # fmt: skip
    _refuse_comments(root, where)
    chain = _embedded(found[0], where)
    signed = _signing_time(found[0], where)
    _refuse_wrong_dates(chain[0], signed, where)
    _refuse_uncovered(root, _verified(content, found[0], chain[0], signed, where), signed, where)
    if ca is not None:
        _refuse_untrusted(chain, certificates(*ca), signed, where, ca[0])
    return _described(found[0], chain[0], signed, "" if ca is None else ca[0])


def _signatures(root: etree._Element) -> list[etree._Element]:
    return list(root.iter(f"{_DS}Signature"))


def _damaged(where: str, why: object) -> RefusedError:
    found = f"no valid signature: {why}".rstrip(": ")
    return RefusedError(where, found, expected="the file as it was signed, unchanged")


def _refuse_comments(root: etree._Element, where: str) -> None:
    """No signature covers an XML comment, and one within a text cuts it for careless readers."""
    from lxml import etree  # noqa: PLC0415  optional

    comment = next(root.iter(etree.Comment), None)
    if comment is not None:
        raise RefusedError(
            f"{where}, line {comment.sourceline}",
            "an XML comment, which no signature covers",
            expected="a certificate without XML comments",
        )


def _embedded(signature: etree._Element, where: str) -> tuple[x509.Certificate, ...]:
    """Certificates in a signature, the signer's first."""
    from cryptography import x509  # noqa: PLC0415  optional

    path = f"{_DS}KeyInfo/{_DS}X509Data/{_DS}X509Certificate"
    try:
        found = [base64.b64decode(e.text or "") for e in signature.findall(path)]
        chain = tuple(x509.load_der_x509_certificate(der) for der in found)
    except ValueError as error:
        raise _damaged(where, f"its certificate is damaged ({error})") from None
    if not chain:
        raise _damaged(where, "no certificate is in it")
    return chain


def _signing_time(signature: etree._Element, where: str) -> datetime:
    """Time that the signature states; it is one of the signed properties."""
    text = signature.findtext(f"{_DS}Object/*/{_PROPERTIES}//{_XADES}SigningTime")
    found = _time(text)
    if found is None:
        why = "it does not state when it was made, as XAdES does"
        raise _damaged(where, why if text is None else f"its time is {text[:40]!r}")
    return found


def _time(text: str | None) -> datetime | None:
    try:
        found = datetime.fromisoformat(text or "")
    except ValueError:
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _refuse_wrong_dates(cert: x509.Certificate, signed: datetime, where: str) -> None:
    if not cert.not_valid_before_utc <= signed <= cert.not_valid_after_utc:
        raise RefusedError(
            where,
            f"signed {signed:{MINUTE}} UTC with a certificate that is valid from "
            f"{cert.not_valid_before_utc:{MINUTE}} to {cert.not_valid_after_utc:{MINUTE}}",
            expected="a certificate that was valid then",
        )
    if signed > datetime.now(UTC):
        raise RefusedError(where, f"signed {signed}, which is yet to come", expected="a past time")


def _verified(
    content: bytes, signature: etree._Element, cert: x509.Certificate, signed: datetime, where: str
) -> list[etree._Element]:
    """Roots of what the signature covers: each part has the hash that the key has signed."""
    from cryptography.exceptions import UnsupportedAlgorithm  # noqa: PLC0415  optional
    from lxml import etree  # noqa: PLC0415
    from signxml.exceptions import InvalidDigest, SignXMLException  # noqa: PLC0415
    from signxml.xades import XAdESSignatureConfiguration, XAdESVerifier  # noqa: PLC0415

    references = len(signature.findall(f"{_DS}SignedInfo/{_DS}Reference"))
    config = XAdESSignatureConfiguration(
        location="./", expect_references=max(references, _FEWEST), verification_time=signed
    )
    damaged = (ValueError, AttributeError, TypeError, KeyError, UnsupportedAlgorithm)
    try:
        results = XAdESVerifier().verify(content, x509_cert=cert, expect_config=config)
    except InvalidDigest:
        raise RefusedError(
            where, "was changed after it was signed", expected="the file as it was signed"
        ) from None
    except (SignXMLException, etree.LxmlError, *damaged) as error:
        raise _damaged(where, error) from None
    return [etree.fromstring(r.signed_data) for r in results if r.signed_xml is not None]


def _refuse_uncovered(
    root: etree._Element, covered: list[etree._Element], signed: datetime, where: str
) -> None:
    """That something is signed is not enough: it must be this whole document, and its time."""
    root.remove(_signatures(root)[0])
    if _canonical(root) not in map(_canonical, covered):
        raise _damaged(where, "it does not cover the whole certificate")
    times = [c.findtext(f".//{_XADES}SigningTime") for c in covered if c.tag == _PROPERTIES]
    if not any(_time(text) == signed for text in times):
        raise _damaged(where, "its time is not among what is signed")


def _canonical(element: etree._Element) -> bytes:
    from lxml import etree  # noqa: PLC0415  optional

    found: bytes = etree.tostring(element, method="c14n", with_comments=False)
    return found


def _refuse_untrusted(
    chain: tuple[x509.Certificate, ...],
    trusted: tuple[x509.Certificate, ...],
    signed: datetime,
    where: str,
    name: str,
) -> None:
    """Refuse a certificate that is not in the user's file, nor issued by one that is."""
    if chain[0] in trusted:
        return
    from cryptography.x509 import verification  # noqa: PLC0415  optional

    policy = verification.ExtensionPolicy
    builder = verification.PolicyBuilder().store(verification.Store(list(trusted)))
    builder = builder.time(signed).extension_policies(
        ca_policy=policy.webpki_defaults_ca(), ee_policy=policy.permit_all()
    )
    try:
        builder.build_client_verifier().verify(chain[0], list(chain[1:]))
    except (verification.VerificationError, ValueError) as error:
        raise RefusedError(
            where,
            f"the certificate of {printable(chain[0].subject)}, issued by "
            f"{printable(chain[0].issuer)}, is not vouched for: {_short(error)}",
            expected=f"a certificate in {name}, or issued by an authority in it",
        ) from None


def _short(error: Exception) -> str:
    """Reason of the package cryptography without the dump of a certificate that it adds."""
    return str(error).partition(" (encountered")[0].strip()


def _described(
    signature: etree._Element, cert: x509.Certificate, signed: datetime, trusted_by: str
) -> Signature:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415  optional

    method: Any = signature.find(f"{_DS}SignedInfo/{_DS}SignatureMethod")
    return Signature(
        printable(cert.subject),
        printable(cert.issuer),
        cert.fingerprint(hashes.SHA256()).hex(),
        method.get("Algorithm").rpartition("#")[2],
        signed,
        cert.not_valid_before_utc,
        cert.not_valid_after_utc,
        trusted_by,
    )
