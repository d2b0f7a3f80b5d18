"""Signatures of certificates: made, verified, and everything that is none."""

from __future__ import annotations

import datetime
import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import triaxcal
from dcc_cases import cert_of, cert_pem, faults, key_of, pem, public_pem, ssh
from test_stated import of, whole
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.unit import Delivery
from triaxcal.report.dcc.certificate import certificate_xml

pytest.importorskip("signxml")
pytest.importorskip("cryptography")


@pytest.fixture(scope="module")
def plain(delivered: dict[str, Delivery]) -> bytes:
    made = of(delivered["AT-SIM"], whole())
    details = made.delivery.unit.certificate
    assert details is not None
    return certificate_xml(made, details)


@pytest.fixture(scope="module")
def keys() -> dict[str, Any]:
    """Keys by kind; making RSA takes time."""
    return {kind: key_of(kind) for kind in ("rsa", "short", "ec", "p521", "k1", "ed25519")}


class Desk:
    """A folder with certificate.dcc.xml, and files that a test adds."""

    def __init__(self, folder: Path, content: bytes) -> None:
        self.folder = folder
        self.path = self.put("certificate.dcc.xml", content)
        self.signed = folder / "certificate.signed.dcc.xml"

    def put(self, name: str, content: bytes) -> Path:
        path = self.folder / name
        path.write_bytes(content)
        return path

    def sign(self, key: bytes, cert: bytes, **more: Any) -> Path:
        paths = self.put("key.pem", key), self.put("cert.pem", cert)
        return triaxcal.sign_certificate(self.path, *paths, **more)

    def refused(self, key: bytes, cert: bytes, **more: Any) -> str:
        with pytest.raises(RefusedError) as refusal:
            self.sign(key, cert, **more)
        assert not self.signed.exists()
        text = str(refusal.value)
        assert "\n" not in text
        assert "PRIVATE KEY-----" not in text
        return text


@pytest.fixture
def desk(tmp_path: Path, plain: bytes) -> Desk:
    return Desk(tmp_path, plain)


def refused(path: Path, ca: Path | None = None) -> str:
    with pytest.raises(RefusedError) as refusal:
        triaxcal.verify_certificate(path, ca)
    assert refusal.value.exit_code == 1
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


@pytest.mark.parametrize(
    ("kind", "method"),
    [("rsa", "rsa-sha256"), ("ec", "ecdsa-sha256"), ("p521", "ecdsa-sha512")],
)
def test_a_signed_certificate_is_verified_and_still_valid(
    desk: Desk, keys: dict[str, Any], plain: bytes, kind: str, method: str
) -> None:
    cert = cert_of(keys[kind])
    path = desk.sign(pem(keys[kind]), cert_pem(cert))
    assert path == desk.signed
    assert desk.path.read_bytes() == plain
    found = triaxcal.verify_certificate(path)
    assert (found.subject, found.method, found.trusted_by) == ("CN=N. N.", method, "")
    assert abs(found.signed - datetime.datetime.now(datetime.UTC)).total_seconds() < 600
    assert "Not shown: who holds this key." in str(found)
    trusted = triaxcal.verify_certificate(path, desk.folder / "cert.pem")
    assert "cert.pem vouches for this one" in str(trusted)
    assert "Not shown: that it was not revoked" in str(trusted)
    # What was there before is there still, byte for byte, up to the signature.
    content = path.read_bytes()
    head = plain.partition(b"?>\n")[2].partition(b"</dcc:digitalCalibrationCertificate>")[0]
    assert head in content
    assert content.count(b"<ds:Signature ") == 1


def test_a_signed_certificate_is_valid_by_the_schema(desk: Desk, keys: dict[str, Any]) -> None:
    assert faults(desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"]))).read_bytes()) == ()


TAMPERED = [
    (b"2026-03-30<", b"2026-03-29<", "was changed after it was signed"),
    (b"<dcc:conformity>pass", b"<dcc:conformity>fail", "was changed after it was signed"),
    (b" <dcc:items>", b"  <dcc:items>", "was changed after it was signed"),
    (b"schemaVersion=", b'id="x" schemaVersion=', "was changed after it was signed"),
    (b"<ds:SignatureValue>", b"<ds:SignatureValue>AAAA", "no valid signature: "),
    (b"<ds:DigestValue>", b"<ds:DigestValue>AAAA", "no valid signature: "),
    (b"SigningTime>2", b"SigningTime>1", "with a certificate that is valid from"),
    (b"<xades:SigningTime>", b"<xades:SigningTime>x", "no valid signature: its time is 'x"),
    (b"<ds:X509Certificate>M", b"<ds:X509Certificate>", "its certificate is damaged"),
    (b"Digital Calibration Certificate</xades", b"x</xades", "was changed after it was signed"),
]


@pytest.mark.parametrize(("old", "new", "message"), TAMPERED)
def test_a_tampered_file_is_refused(
    desk: Desk, keys: dict[str, Any], old: bytes, new: bytes, message: str
) -> None:
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"])))
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    assert message in refused(path)
    result = CliRunner().invoke(main, ["certificate", "verify", str(path)])
    assert isinstance(result.exception, RefusedError)


def test_every_digit_of_the_results_is_covered(desk: Desk, keys: dict[str, Any]) -> None:
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"])))
    content = path.read_bytes()
    places = [m.end() for m in re.finditer(rb"XMLList>[-0-9]", content)]
    assert len(places) > 10
    for place in places[:12]:
        digit = content[place : place + 1]
        path.write_bytes(content[:place] + (b"8" if digit != b"8" else b"7") + content[place + 1 :])
        assert "was changed after it was signed" in refused(path)


def test_a_signature_of_something_else_does_not_count(desk: Desk, keys: dict[str, Any]) -> None:
    """The signature of another certificate moved here, and one wrapped in another document."""
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"])))
    content = path.read_bytes()
    signature = re.search(rb"(?s)<ds:Signature .*</ds:Signature>", content)
    assert signature is not None
    moved = desk.path.read_bytes().replace(b"UA<", b"DE<")
    end = b"</dcc:digitalCalibrationCertificate>"
    path.write_bytes(moved.replace(end, signature[0] + end))
    assert "was changed after it was signed" in refused(path)
    # The whole signed certificate hidden in a comment element of a forged one.
    whole_one = content.partition(b"?>\n")[2].strip()
    path.write_bytes(moved.replace(end, b"<dcc:comment>" + whole_one + b"</dcc:comment>" + end))
    assert "has its signature inside another element" in refused(path)
    path.write_bytes(
        moved.replace(end, b"<dcc:comment>" + whole_one + b"</dcc:comment>" + signature[0] + end)
    )
    assert "has 2 signatures; expected one signature" in refused(path)


def signed_by_others(plain: bytes, key: Any, *, references: int) -> bytes:
    """A signature as other programs make it: fewer references than ours."""
    from lxml import etree
    from signxml import DigestAlgorithm, SignatureMethod, XMLSigner
    from signxml.xades import XAdESSigner

    class Other(XAdESSigner):
        def _add_reference_to_signed_info(self, sig_root: Any, node: Any, **attrs: str) -> None:
            if attrs and references == 2:  # that of the signed properties alone has a type
                super()._add_reference_to_signed_info(sig_root, node, **attrs)

    how = {"signature_algorithm": SignatureMethod.ECDSA_SHA256}
    signer = Other(**how) if references else XMLSigner(**how)
    assert signer.digest_alg is DigestAlgorithm.SHA256
    made = signer.sign(etree.fromstring(plain), key=key, cert=[cert_of(key)])
    found: bytes = etree.tostring(made)
    return found


def test_signatures_of_other_programs(desk: Desk, keys: dict[str, Any], plain: bytes) -> None:
    """XAdES refers to the document and the signed properties; without these it is not XAdES."""
    path = desk.put("theirs.xml", signed_by_others(plain, keys["ec"], references=2))
    assert triaxcal.verify_certificate(path).subject == "CN=N. N."
    path.write_bytes(path.read_bytes().replace(b"2026-03-30<", b"2026-03-29<"))
    assert "was changed after it was signed" in refused(path)
    path.write_bytes(signed_by_others(plain, keys["ec"], references=1))
    assert "no valid signature: " in refused(path)
    path.write_bytes(signed_by_others(plain, keys["ec"], references=0))
    assert "it does not state when it was made, as XAdES does" in refused(path)


def test_unsigned_and_signed_twice(desk: Desk, keys: dict[str, Any]) -> None:
    assert "certificate.dcc.xml: is not signed; expected one signature, of the" in refused(
        desk.path
    )
    key, cert = pem(keys["ec"]), cert_pem(cert_of(keys["ec"]))
    path = desk.sign(key, cert)
    with pytest.raises(RefusedError) as refusal:
        desk.sign(key, cert)
    assert str(refusal.value).endswith("exists already; move it away, or name another file")
    with pytest.raises(RefusedError) as refusal:
        triaxcal.sign_certificate(path, desk.folder / "key.pem", desk.folder / "cert.pem")
    assert "is signed already; expected a certificate without a signature" in str(refusal.value)
    content = path.read_bytes()
    (signature,) = re.findall(rb"(?s)<ds:Signature .*</ds:Signature>", content)
    path.write_bytes(content.replace(signature, signature + signature))
    assert "has 2 signatures; expected one signature" in refused(path)


def test_the_wrong_kind_of_key(desk: Desk, keys: dict[str, Any]) -> None:
    good, cert = pem(keys["rsa"]), cert_pem(cert_of(keys["rsa"]))
    private, public = ssh(keys["rsa"])
    for content, message in (
        (public_pem(keys["rsa"]), "key.pem: a public key; expected a private key in PEM, RSA or"),
        (private, "key.pem: a key of SSH; expected a private key in PEM"),
        (public, "key.pem: a public key of SSH; expected"),
        (cert, "key.pem: a certificate; expected a private key in PEM, RSA or EC (P-256, P-384, "),
        (b"", "key.pem: an empty file"),
        (b"secret", "key.pem: no PEM; expected"),
        (b"\x30\x82\x01\x02", "key.pem: no PEM: DER or PKCS #12; expected"),
        (good.replace(b"M", b"", 5), "key.pem: damaged (ValueError); expected"),
        (pem(keys["short"]), "key.pem: RSA of 1024 bits; expected 2048 bits or more"),
        (pem(keys["k1"]), "key.pem: a key of EC secp256k1; expected"),
        (pem(keys["ed25519"]), "key.pem: a key of Ed25519; expected"),
    ):
        assert message in desk.refused(content, cert)


def test_a_certificate_that_does_not_serve(desk: Desk, keys: dict[str, Any]) -> None:
    good = keys["ec"]
    for key, cert, message in (
        (good, cert_of(keys["rsa"]), ("the key (EC secp256r1) is not that of the first certificate "
         "(RSA 2048, CN=N. N.); expected a certificate of this key")),
        (good, cert_of(key_of("ec")), "is not that of the first certificate (EC secp256r1, CN="),
        (good, cert_of(good, days=(-9, -2)), "cert.pem: the certificate is valid from "),
        (good, cert_of(good, days=(2, 9)), "; expected one that is valid now, "),
        (good, cert_of(good, signs=False), "cert.pem: its key usage is not for signatures"),
    ):  # fmt: skip
        assert message in desk.refused(pem(key), cert_pem(cert))
    message = "cert.pem: a file with PRIVATE KEY; expected an X.509 certificate in PEM"
    assert message in desk.refused(pem(good), pem(good))
    assert "cert.pem: no PEM; expected" in desk.refused(pem(good), b"x")
    damaged = cert_pem(cert_of(good)).replace(b"M", b"", 3)
    assert "cert.pem: damaged: " in desk.refused(pem(good), damaged)


def test_an_encrypted_key(desk: Desk, keys: dict[str, Any]) -> None:
    key, cert = pem(keys["ec"], b"word"), cert_pem(cert_of(keys["ec"]))
    text = desk.refused(key, cert)
    assert "key.pem: encrypted, and no passphrase is given; expected its passphrase" in text
    text = desk.refused(key, cert, passphrase="other")
    assert "key.pem: the passphrase does not open it, or it is damaged (ValueError)" in text
    text = desk.refused(pem(keys["ec"]), cert, passphrase="word")
    assert "key.pem: not encrypted; expected a key that the passphrase opens" in text
    desk.put("key.pem", key)
    result = sign_by_command(desk, "--passphrase-file", "-", typed="word\n")
    assert result.exit_code == 0, result.exception
    assert triaxcal.verify_certificate(desk.signed).subject == "CN=N. N."


def test_a_passphrase_need_not_be_text(desk: Desk, keys: dict[str, Any]) -> None:
    desk.put("key.pem", pem(keys["ec"], b"w\xffrd"))
    desk.put("cert.pem", cert_pem(cert_of(keys["ec"])))
    secret = desk.put("secret", b"w\xffrd\r\nmore")
    result = sign_by_command(desk, "--passphrase-file", str(secret))
    assert result.exit_code == 0, result.exception
    assert desk.signed.exists()


def test_a_folder_is_no_certificate(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk.folder)
    with pytest.raises(RefusedError, match=r"^\.: cannot be read"):
        triaxcal.sign_certificate(".", "key.pem", "cert.pem")


def sign_by_command(desk: Desk, *more: str, typed: str = "") -> Result:
    files = ["--key", str(desk.folder / "key.pem"), "--cert", str(desk.folder / "cert.pem")]
    command = ["certificate", "sign", str(desk.path), *files, *more]
    return CliRunner().invoke(main, command, input=typed)


def test_an_authority_vouches_or_does_not(desk: Desk, keys: dict[str, Any]) -> None:
    root_key, middle_key = key_of("ec"), key_of("ec")
    root = cert_of(root_key, "Root", ca=True, days=(-9, 90))
    middle = cert_of(middle_key, "Middle", issuer=(root, root_key), ca=True, days=(-9, 90))
    leaf = cert_of(keys["ec"], issuer=(middle, middle_key))
    path = desk.sign(pem(keys["ec"]), cert_pem(leaf, middle))
    ca = desk.put("root.pem", cert_pem(root))
    assert str(triaxcal.verify_certificate(path, ca)).count("root.pem vouches for this one") == 1
    other = desk.put("other.pem", cert_pem(cert_of(root_key, "Other", ca=True)))
    text = refused(path, other)
    assert "the certificate of CN=N. N., issued by CN=Middle, is not vouched for: " in text
    assert text.endswith("other.pem, or issued by an authority in it")
    # The same name with another key.
    fake = desk.put("fake.pem", cert_pem(cert_of(key_of("ec"), "Root", ca=True)))
    assert "is not vouched for" in refused(path, fake)
    # One that is no authority cannot vouch.
    no_ca = cert_of(root_key, "Root", days=(-9, 90))
    assert "is not vouched for" in refused(path, desk.put("no.pem", cert_pem(no_ca)))
    # Nor does a certificate that anybody made with the signer's name.
    assert "is not vouched for" in refused(path, desk.put("me.pem", cert_pem(cert_of(root_key))))
    assert "x.pem: no PEM; expected an X.509" in refused(path, desk.put("x.pem", b"x"))


def test_a_certificate_of_the_wrong_authority_chain(desk: Desk, keys: dict[str, Any]) -> None:
    """A leaf that is no authority has issued the signer's certificate."""
    root_key, shop_key = key_of("ec"), key_of("ec")
    root = cert_of(root_key, "Root", ca=True, days=(-9, 90))
    shop = cert_of(shop_key, "Shop", issuer=(root, root_key))
    leaf = cert_of(keys["ec"], issuer=(shop, shop_key))
    path = desk.sign(pem(keys["ec"]), cert_pem(leaf, shop))
    assert "is not vouched for" in refused(path, desk.put("root.pem", cert_pem(root)))


def test_a_missing_package_is_named(
    desk: Desk, keys: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"])))
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "signxml" else found(name)
    )
    text = refused(path)
    assert "certificate.signed.dcc.xml: missing packages: signxml; install them: " in text
    assert text.endswith("-m pip install 'triaxcal[sign]'")


def test_a_certificate_that_has_expired_since_is_said() -> None:
    day = datetime.datetime(2026, 1, 5, 12, 30, tzinfo=datetime.UTC)
    year = datetime.timedelta(days=365)
    found = triaxcal.Signature("CN=S", "CN=I", "ab", "rsa-sha256", day, day - year, day, "")
    text = " ".join(str(found).split())
    assert "on 2026-01-05 12:30 UTC, as the signer's computer said" in text
    assert "valid 2025-01-05 12:30 to 2026-01-05 12:30 UTC (expired since)" in text


def test_an_xml_comment_is_covered_by_no_signature(desk: Desk, keys: dict[str, Any]) -> None:
    key, cert = pem(keys["ec"]), cert_pem(cert_of(keys["ec"]))
    path = desk.sign(key, cert)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"<dcc:street>c", b"<dcc:street>c<!-- x -->"))
    assert "an XML comment, which no signature covers; expected a certificate without" in refused(
        path
    )
    path.unlink()
    desk.put(
        "certificate.dcc.xml",
        desk.path.read_bytes().replace(b"<dcc:city>", b"<!-- x --><dcc:city>"),
    )
    assert "an XML comment, which no signature covers" in desk.refused(key, cert)


def test_a_name_in_a_certificate_cannot_speak_for_us(desk: Desk, keys: dict[str, Any]) -> None:
    name = "N.\n\nShown: all is well.\x1b[2J" + "x" * 20
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"], name)))
    text = str(triaxcal.verify_certificate(path))
    assert "signed by    CN=N.\\x0a\\x0aShown: all is well.\\x1b[2Jx" in text
    assert "\x1b" not in text
    other = desk.put("other.pem", cert_pem(cert_of(key_of("ec"))))
    assert "CN=N.\\x0a\\x0aShown: all is well.\\x1b[2J" in refused(path, other)


def test_the_commands(desk: Desk, keys: dict[str, Any]) -> None:
    desk.put("key.pem", pem(keys["ec"]))
    desk.put("cert.pem", cert_pem(cert_of(keys["ec"])))
    done = sign_by_command(desk, "--to", str(desk.folder / "out.xml"))
    assert done.exit_code == 0
    assert " ".join(done.output.split()) == f"{desk.folder / 'out.xml'} written"
    done = CliRunner().invoke(main, ["certificate", "verify", str(desk.folder / "out.xml")])
    assert done.exit_code == 0
    assert done.output.startswith("signed by    CN=N. N.\n")
    missing = sign_by_command(desk, "--to", str(desk.folder / "none" / "out.xml"))
    assert "none: no such folder" in str(missing.exception)
    (desk.folder / "key.pem").unlink()
    assert "key.pem: cannot be read: no such file" in str(sign_by_command(desk).exception)


def test_a_signed_file_stands_beside_a_delivered_folder(
    tmp_path: Path, plain: bytes, keys: dict[str, Any]
) -> None:
    (tmp_path / "U").mkdir()
    desk = Desk(tmp_path / "U", plain)
    desk.put("calibration.json", b"{}")
    path = desk.sign(pem(keys["ec"]), cert_pem(cert_of(keys["ec"])))
    assert path == tmp_path / "U.certificate.signed.dcc.xml"
