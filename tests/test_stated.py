"""What a laboratory states: checked when it is read, and found in page, JSON and certificate."""

from __future__ import annotations

import datetime
import hashlib
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys
from triaxcal.base.tomltext import toml_value
from triaxcal.delivery.inputs import inputs_sha256, without_papers
from triaxcal.delivery.unit import Delivery
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.report.stated.words import label
from triaxcal.report.texts.speaker import speaker
from triaxcal.unit.certificate import CERTIFICATE
from triaxcal.unit.description import UnitDescription, unit_of_text
from triaxcal.unit.equipment import EQUIPMENT
from triaxcal.unit.measured import MEASURED

TABLES = (CERTIFICATE, MEASURED, EQUIPMENT)
UNIT = (Path(__file__).parent.parent / "units/AT-SIM/unit.toml").read_text(encoding="utf-8")
WORDS = {"country": "UA", "performed_at": "customer"}
DATES = {
    "begin": "2026-03-30", "end": "2026-04-07", "issued": "2026-04-09", "date": "2026-04-02",
    "calibrated": "2025-11-03", "due": "2026-11-05",
}  # fmt: skip
NUMBERS = {
    "ambient_degc": [21.25, 24.5], "humidity_percent": [34.5, 51.75],
    "pressure_hpa": [1007.5, 1013.25],
}  # fmt: skip


def value_of(table: TableKeys, name: str, number: int = 0) -> Any:
    """A value that no other key has."""
    if name in DATES:
        return datetime.date.fromisoformat(DATES[name])
    return NUMBERS.get(name) or WORDS.get(name) or f"{table.name}, {name} <&> {number}"


def whole(*without: str) -> str:
    """unit.toml with every key stated but those of these names."""
    text = UNIT
    for table, number in ((CERTIFICATE, 0), (MEASURED, 0), (EQUIPMENT, 1), (EQUIPMENT, 2)):
        text += f"\n{table.header}\n" if table.name not in without else ""
        for key in table.keys:
            if table.name not in without and f"{table.name}.{key.name}" not in without:
                text += f"{key.name} = {toml_value(value_of(table, key.name, number))}\n"
    return text


def read(text: str) -> UnitDescription:
    return unit_of_text("AT-SIM", text, "unit.toml")


def of(delivery: Delivery, text: str) -> Passport:
    """Passport of a delivery whose unit states something else."""
    found = read(text)
    stated = {n: getattr(found, n) for n in ("certificate", "measured", "equipment")}
    return passport(replace(delivery, unit=replace(delivery.unit, **stated)), {})


def shown(page: bytes) -> str:
    """Text of a page without its marks."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page.decode())).split())


def test_every_key_is_in_page_and_json_and_certificate(delivered: dict[str, Delivery]) -> None:
    made = of(delivered["AT-SIM"], whole())
    page, document = shown(passport_html(made)), json.loads(passport_json(made))
    details = made.delivery.unit.certificate
    assert details is not None
    root = ET.fromstring(certificate_xml(made, details))
    certificate = " ".join(" ".join(root.itertext()).split())
    for table in TABLES:
        for key in table.keys:
            for number in (1, 2) if table.many else (0,):
                value = value_of(table, key.name, number)
                rows = document["stated"][table.name]
                found = rows[number - 1][key.name] if table.many else rows[key.name]
                assert found == (value if isinstance(value, list) else str(value)), key.name
                words = [f"{v:g}" for v in value] if isinstance(value, list) else [str(value)]
                for place in (page, certificate):
                    assert all(word in place for word in words), key.name
            assert label(f"{table.name}.{key.name}", speaker("en")) in page
    assert document["stated"]["cautions"] == []


def test_what_is_not_stated_is_said(delivered: dict[str, Delivery]) -> None:
    made = of(delivered["AT-SIM"], UNIT)
    page, document = shown(passport_html(made)), json.loads(passport_json(made))
    missing = page.partition("Not stated: ")[2].partition(".")[0].split("; ")
    single = [
        label(f"{t.name}.{k.name}", speaker("en")) for t in (CERTIFICATE, MEASURED) for k in t.keys
    ]
    assert missing == [*single, "Equipment"]
    assert document["stated"]["equipment"] == []
    assert set(document["stated"]["certificate"].values()) == {None}
    assert set(document["stated"]["measured"].values()) == {None}
    # One key left out is missed alone.
    made = of(delivered["AT-SIM"], whole("measured.place", "equipment.model"))
    page = shown(passport_html(made))
    assert "Not stated: Place." in page
    assert page.count("not stated") == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "issued = 2026-04-09", "issued = 2026-04-06",
            "[certificate] issued: found 2026-04-06; expected 2026-04-07 (end) or later",
        ),
        (
            "\ndate = 2026-04-02", "\ndate = 2026-04-08",
            ("[measured] date: found 2026-04-08; expected a day from 2026-03-30 to 2026-04-07, as "
            "[certificate] begin and end say"),
        ),
        (
            "calibrated = 2025-11-03", "calibrated = 2026-04-08",
            ("[[equipment]] number 1, calibrated: found 2026-04-08; expected 2026-04-07 "
            "([certificate] end) or earlier; state the calibration that was valid at the"),
        ),
        (
            "due = 2026-11-05", "due = 2025-11-02",
            "[[equipment]] number 1, due: found 2025-11-02; expected 2025-11-03 (calibrated) or",
        ),
        ('second_signer = "certificate, second_signer <&> 0"', "", "expected second_signer beside"),
        ("[21.25, 24.5]", "[24.5, 21.25]", "[measured] ambient_degc: found [24.5, 21.25];"),
        ("[34.5, 51.75]", "[34.5, 151.75]", "humidity_percent: found [34.5, 151.75]; expected a"),
        ("[34.5, 51.75]", "40", "humidity_percent: found 40; expected a list of lowest and"),
        ('"customer"', '"home"', 'performed_at: found \'home\'; expected one of "laboratory"'),
        ('"measured, place <&> 0"', '""', "[measured] place: found ''; expected one line of text"),
        ('"measured, place <&> 0"', '"\\u0000"', "[measured] place: found '\\x00'; expected one"),
        ('"measured, place <&> 0"', f'"{"x" * 201}"', "expected one line of text of 1 to 200"),
        ('"equipment, name <&> 2"', "2", "[[equipment]] number 2, name: found 2; expected"),
        ('name = "equipment, name <&> 2"', "", "missing: [[equipment]] number 2, name (or"),
        ("due = ", "dew = ", "unknown: [[equipment]] number 1, dew (did you mean"),
    ],
)  # fmt: skip
def test_what_is_stated_is_checked(old: str, new: str, message: str) -> None:
    assert read(whole()).certificate is not None
    assert old in whole()
    with pytest.raises(RefusedError) as refusal:
        read(whole().replace(old, new, 1))
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("equipment = 3", "unit.toml, equipment: found 3; expected a table [[equipment]] for each"),
        ("equipment = [1]", "equipment: found [1]; expected a table [[equipment]] for each"),
        ("[equipment]\nname = 'x'", "equipment: found a table; expected a table [[equipment]] for"),
    ],
)
def test_equipment_is_a_list_of_tables(line: str, message: str) -> None:
    top, site = UNIT.split("\n[adc]", 1)
    text = f"{top}\n{line}\n[adc]{site}"
    with pytest.raises(RefusedError) as refusal:
        read(text)
    assert message in str(refusal.value)


def test_one_instrument_is_stated_once() -> None:
    twice = whole().replace(" <&> 2", " <&> 1")
    with pytest.raises(RefusedError, match=r"number 2, name: .*another instrument than number 1"):
        read(twice)


CAUTIONS = [
    (
        whole().replace("due = 2026-11-05", "due = 2026-04-06", 1),
        (
            "equipment, name <&> 1: its calibration was due on 2026-04-06, before the last day of "
            "the measurements, 2026-04-07"
        ),
    ),
    (
        whole().replace('certificate = "equipment, certificate <&> 1"\n', ""),
        (
            "equipment, name <&> 1: number or day of its calibration certificate is not stated, so "
            "its traceability is not shown"
        ),
    ),
    (
        whole().replace('traceable_to = "equipment, traceable_to <&> 2"\n', ""),
        "equipment, name <&> 2: to what its calibration is traceable is not stated",
    ),
    (whole("equipment"), "no equipment is stated, so traceability is not shown"),
    (
        whole("certificate", "measured.date"),
        (
            "no day of the measurements is stated, so the dates of the equipment were not compared "
            "with it"
        ),
    ),
]


@pytest.mark.parametrize(("text", "caution"), CAUTIONS)
def test_what_is_half_filled_is_said(
    delivered: dict[str, Delivery], text: str, caution: str
) -> None:
    made = of(delivered["AT-SIM"], text)
    assert json.loads(passport_json(made))["stated"]["cautions"] == [caution]
    assert f"{caution[0].upper()}{caution[1:]}." in shown(passport_html(made))


@pytest.mark.parametrize("form", ["appended", "between", "changed", "indented"])
def test_what_the_constants_do_not_hang_on_is_not_in_their_hash(tmp_path: Path, form: str) -> None:
    """The certificate is filled in after the device was flashed and verified."""
    (tmp_path / "measurements.csv").write_text("x", encoding="utf-8")
    path = tmp_path / "unit.toml"

    def found(text: str) -> str:
        path.write_text(text, encoding="utf-8")
        return inputs_sha256(tmp_path)

    plain = UNIT.rstrip("\n") + "\n"
    papers = whole("measured").removeprefix(UNIT)
    first = found(plain)
    # As the hash was before there was anything to leave out.
    parts = (hashlib.sha256(part).digest() for part in (plain.encode(), b"x"))
    assert first == hashlib.sha256(b"".join(parts)).hexdigest()
    windows = [without_papers(t.replace("\n", "\r\n").encode()) for t in (plain, plain + papers)]
    assert windows[0] == windows[1]
    text = {
        "appended": plain + papers,
        "between": plain.replace("[site]", f"{papers.strip()}\n\n[site]"),
        "changed": plain + papers.replace("2026-04-09", "2026-04-10"),
        "indented": plain + "\n  [ certificate ]\n  identifier = 'a'\n[passport]\nx = 1\n",
    }[form]
    assert found(text) == first
    assert found(text.replace("bits = 24", "bits = 23")) != first
    assert found(text + "\n[measured]\nrig = 'other'\n") != first


def test_what_only_looks_like_a_table_stays_in_the_hash() -> None:
    hidden = UNIT + '\n[fit]\nnote = """\n[certificate]\n"""\nestimator = "x"\n[passport]\n'
    assert without_papers(hidden.encode()) == hidden.encode()
    inline = f'certificate = {{identifier = "a"}}\n{UNIT}'
    assert without_papers(inline.encode()) == inline.encode()
    assert without_papers(b"\xff[certificate]") == b"\xff[certificate]"


def test_a_number_of_the_certificate_fits_the_code_to_scan(
    delivered: dict[str, Delivery],
) -> None:
    """Four bytes a character is the most of UTF-8; one character more is refused by name."""
    text = whole().replace("certificate, identifier <&> 0", "\U0001f600" * 200)
    assert "\U0001f600" * 200 in shown(passport_html(of(delivered["AT-SIM"], text)))
    with pytest.raises(RefusedError, match=r"\[certificate\] identifier.*1 to 200 characters"):
        read(text.replace("\U0001f600", "xx", 1))
