"""Certificates against PTB's schema, and texts that try to break them."""

from __future__ import annotations

import random
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from dcc_cases import faults, schemas
from test_stated import UNIT, of, read, whole
from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltext import toml_value
from triaxcal.cli.certificate import SCHEMAS
from triaxcal.cli.main import main
from triaxcal.delivery.unit import Delivery
from triaxcal.device.record import DeviceRecord, PositionResult, sha256_of
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.dcc.elements import DCC
from triaxcal.report.dcc.schema import SCHEMA_FILES, schema_faults
from triaxcal.report.passport.content import Passport, passport

NEEDED = """
[certificate]
identifier = "C-17"
laboratory = "Laboratory"
city = "Kyiv"
country = "UA"
customer = "Customer"
signer = "N. N."
manufacturer = "Maker"
begin = 2026-03-30
end = 2026-03-31
"""


def xml(made: Passport) -> bytes:
    details = made.delivery.unit.certificate
    assert details is not None
    return certificate_xml(made, details)


@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
@pytest.mark.parametrize("text", [whole(), UNIT + NEEDED, whole("equipment", "measured")])
def test_shipped_units_are_valid(delivered: dict[str, Delivery], name: str, text: str) -> None:
    """AT-CHERNIAK is one that is not shown to pass."""
    assert faults(xml(of(delivered[name], text))) == ()


def test_with_a_device_that_was_verified(delivered: dict[str, Delivery]) -> None:
    delivery = of(delivered["AT-SIM"], whole()).delivery
    image = sha256_of(delivery.files["triax_calib.bin"])
    at = PositionResult("CP1", 32, 20.0, (0.6, 0.0, 0.8), 1e-6, 1e-7, 3e-4)
    record = DeviceRecord("U", "S", "HW <&> ]]>", "", image, "2026-03-30", 9.81, 0, (at,))
    content = xml(passport(delivery, {}, record))
    assert faults(content) == ()
    assert "verified on device HW &lt;&amp;&gt; ]]&gt;, 2026-03-30" in content.decode()
    hostile = passport(delivery, {}, replace(record, hardware="\x01"))
    with pytest.raises(RefusedError) as refusal:
        xml(hostile)
    assert "certificate, content: found 'verified on device" in str(refusal.value)
    assert "with the character U+0001; expected characters that XML can hold" in str(refusal.value)


def test_the_schema_is_really_applied(delivered: dict[str, Delivery]) -> None:
    content = xml(of(delivered["AT-SIM"], whole())).decode()
    for old, new, said in (
        ("(</?dcc:)countryCodeI", r"\1landCodeI", "landCode"),
        ("2026-03-30<", "2026-02-30<", "beginPerformanceDate"),
        (">conditionalPass<|>pass<", ">perhaps<", "conformity"),
        (r"(?s)<dcc:item>.*</dcc:item>", "", "items"),
        (r"<si:valueXMLList>", "<si:valueXMLList>x ", "valueXMLList"),
    ):
        broken, count = re.subn(old, new, content)
        assert count, old
        found = faults(broken.encode())
        assert found, old
        assert said in found[0]
        assert found[0].startswith("line ")


HOSTILE = [
    "]]>", "<!--", "-->", "<![CDATA[x]]>", "&lt;&#0;", "\"'`", "</dcc:content>", "%s{}{0}", "\\one",
    "<script>alert(1)</script>", "שלום עולם", "مختبر", "中文名称", "Ґ'є", "😀", "é" * 63, "a b  c",
]  # fmt: skip
FORBIDDEN = ["\x00", "\x0b", "\x7f", "a\nb", "\x1b[0m", "\u202e", "\u200f", "\ufffe", "\ud800", ""]


def with_text(words: str) -> str:
    """Every key of text with these words, and what keeps two instruments apart."""
    text = whole()
    for value in set(re.findall(r'= ("[a-z]+, [^"]* <&> [012]")', text)):
        number = value[-2] if value.startswith('"equipment, serial') else ""
        text = text.replace(value, toml_value(f"{words}{number}"))
    return text


@pytest.mark.parametrize("words", HOSTILE)
def test_hostile_text_is_read_back_as_it_was(delivered: dict[str, Delivery], words: str) -> None:
    etree = pytest.importorskip("lxml.etree")
    content = xml(of(delivered["AT-SIM"], with_text(words)))
    root = etree.fromstring(content)
    text = " ".join(words.split())
    assert root.findtext(f".//{{{DCC}}}uniqueIdentifier") == text
    for path, count in (
        ("customer/dcc:name/dcc:content", 1),
        ("calibrationLaboratory//dcc:street", 1),
        ("calibrationLaboratoryCode", 1),
        ("respPerson/dcc:role", 3),
        ("measuringEquipment/dcc:model", 2),
        ("metaData/dcc:declaration/dcc:content", 3),
    ):
        found = [e.text for e in root.iterfind(f".//dcc:{path}", {"dcc": DCC})]
        assert len(found) == count
        assert text in found
    assert faults(content) == ()


@pytest.mark.parametrize("words", FORBIDDEN)
@pytest.mark.parametrize("key", ["customer", "rig", "operator", "traceable_to"])
def test_text_that_xml_cannot_hold_is_refused_with_its_key(words: str, key: str) -> None:
    value = toml_value(words).replace("\ud800", "\\ud800")
    text = re.sub(rf'(?m)^{key} = ".*"$', lambda _: f"{key} = {value}", whole(), count=1)
    with pytest.raises(RefusedError) as refusal:
        read(text)
    assert key in refusal.value.place or "not TOML: Escaped character" in refusal.value.found


def test_a_text_of_a_program_that_is_no_unicode_is_refused() -> None:
    with pytest.raises(RefusedError, match="is not UTF-8; save the file as UTF-8"):
        read(whole().replace("measured, place", "\ud800"))


def test_a_very_long_text_of_an_old_key(delivered: dict[str, Delivery]) -> None:
    """Keys of version 0.1.0 may have any length."""
    words = "".join(random.Random(1).choices("abc <&>]", k=100_000))
    text = re.sub(r'(?m)^customer = ".*"$', lambda _: f"customer = {toml_value(words)}", whole())
    content = xml(of(delivered["AT-SIM"], text))
    assert faults(content) == ()


# ---- files that are no certificates, and folders that are no schema ----

BOMB = (
    '<!DOCTYPE d [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    f'<d xmlns="{DCC}">&b;</d>'
)
OUTSIDE = f'<!DOCTYPE d [<!ENTITY a SYSTEM "file:///etc/hostname">]><d xmlns="{DCC}">&a;</d>'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not XML: "),
        (b"PK\x03\x04", "not XML: "),
        (b"<a>", "not XML: "),
        (b"<a/>", "is <a>; expected a certificate of https://ptb.de/dcc"),
        (BOMB.encode(), "has a document type (DOCTYPE); expected a certificate, which has none"),
        (OUTSIDE.encode(), "has a document type (DOCTYPE)"),
        (
            f'<digitalCalibrationCertificate xmlns="{DCC}" schemaVersion="3.3.0"/>'.encode(),
            "certificate, schemaVersion: found '3.3.0'; expected '3.2.1'; only certificates of",
        ),
    ],
)
def test_what_is_no_certificate_is_refused(content: bytes, message: str) -> None:
    pytest.importorskip("lxml")
    with pytest.raises(RefusedError) as refusal:
        schema_faults(content, Path(), "certificate")
    assert message in str(refusal.value)


def test_a_folder_without_the_schema_is_said(
    delivered: dict[str, Delivery], tmp_path: Path
) -> None:
    pytest.importorskip("lxml")
    path = tmp_path / "certificate.dcc.xml"
    path.write_bytes(xml(of(delivered["AT-SIM"], whole())))
    (tmp_path / "schemas").mkdir()
    command = ["certificate", "check", str(path), "--schemas", str(tmp_path / "schemas")]
    result = CliRunner().invoke(main, command)
    assert isinstance(result.exception, RefusedError)
    assert "without the schema dcc.xsd, SI_Format.xsd, xmldsig-core-schema.xsd" in str(
        result.exception
    )
    assert str(result.exception).endswith("nothing was checked")
    result = CliRunner().invoke(main, [*command[:-1], str(tmp_path / "none")])
    assert isinstance(result.exception, RefusedError)
    assert (result.exception.found, result.exception.exit_code) == ("no such folder", 2)


def test_the_command_says_valid_or_what_is_wrong(
    delivered: dict[str, Delivery], tmp_path: Path
) -> None:
    folder = schemas()
    path = tmp_path / "certificate.dcc.xml"
    content = xml(of(delivered["AT-SIM"], whole()))
    path.write_bytes(content)
    result = CliRunner().invoke(
        main, ["certificate", "check", str(path)], env={SCHEMAS: str(folder)}
    )
    assert result.exit_code == 0
    assert "valid by dcc.xsd 3.2.1 in" in result.output
    path.write_bytes(content.replace(b"<dcc:countryCode>UA", b"<dcc:countryCode>ua"))
    result = CliRunner().invoke(main, ["certificate", "check", str(path), "--schemas", str(folder)])
    assert result.exit_code == 1
    assert "The value 'ua' is not accepted by the pattern" in " ".join(result.output.split())


@pytest.mark.parametrize("name", SCHEMA_FILES)
def test_a_damaged_schema_is_said(
    delivered: dict[str, Delivery], tmp_path: Path, name: str
) -> None:
    folder = shutil.copytree(schemas(), tmp_path / "schemas")
    (folder / name).write_bytes(b"<schema/>")
    with pytest.raises(RefusedError) as refusal:
        schema_faults(xml(of(delivered["AT-SIM"], whole())), folder, "certificate")
    assert str(folder) in refusal.value.place
