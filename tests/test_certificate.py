"""The certificate against the documented order of its elements, the A2L against the plan."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from datetime import date
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from test_stated import of, whole
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import function_format
from triaxcal.codegen.names import names_of
from triaxcal.delivery.unit import Delivery
from triaxcal.report.a2l import calib_a2l
from triaxcal.report.a2l_words import calib_words
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.dcc.elements import DCC, SI
from triaxcal.report.files import CERTIFICATE, all_files
from triaxcal.report.passport.content import passport
from triaxcal.unit.certificate import CertificateDetails
from triaxcal.unit.description import read_unit

UNITS = Path(__file__).parent.parent / "units"
DETAILS = CertificateDetails(
    identifier="C-17", laboratory="Laboratory <A & B>", city="Kyiv", country="UA",
    customer="Customer", signer="N. N.", manufacturer="Maker", begin=date(2026, 3, 30),
    end=date(2026, 3, 31),
)  # fmt: skip

ORDER = {
    "digitalCalibrationCertificate": "administrativeData measurementResults comment? document?",
    "administrativeData": "dccSoftware refTypeDefinitions? coreData items calibrationLaboratory "
    "respPersons customer statements?",
    "dccSoftware": "software+",
    "usedSoftware": "software+",
    "software": "name release type? description?",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ "
    "uniqueIdentifier identifications? receiptDate? beginPerformanceDate endPerformanceDate "
    "performanceLocation issueDate? reportAmendedSubstituted? previousReport?",
    "items": "name? equipmentClass* description? owner? manufacturer? identifications? item+",
    "item": "name equipmentClass* description? installedSoftwares? manufacturer model? "
    "identifications itemQuantities?",
    "identifications": "identification+",
    "identification": "issuer value name?",
    "calibrationLaboratory": "calibrationLaboratoryCode? contact cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "contact": "name eMail? phone? fax? location descriptionData?",
    "customer": "name eMail? phone? fax? location descriptionData?",
    "manufacturer": "name eMail? phone? fax? location? descriptionData?",
    "person": "name eMail? phone? fax? location? descriptionData?",
    "respPersons": "respPerson+",
    "respPerson": "person description? role? mainSigner? cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "statements": "statement+",
    "statement": "name? description? countryCodeISO3166_1* convention? traceable? norm* reference* "
    "declaration? valid? date? period? respAuthority? conformity? data? nonSIDefinition? "
    "nonSIUnit? location?",
    "measurementResults": "measurementResult+",
    "measurementResult": "name description? usedMethods? usedSoftware? measuringEquipments? "
    "influenceConditions? results measurementMetaData?",
    "usedMethods": "usedMethod+",
    "usedMethod": "name description? norm* reference*",
    "influenceConditions": "influenceCondition+",
    "influenceCondition": "name description? status? certificate? data",
    "results": "result+",
    "result": "name description? data",
    "data": "quantity+",
    "quantity": "name? description? (real|realListXMLList) relativeUncertainty?",
    "real": "label? value unit",
    "realListXMLList": "labelXMLList? valueXMLList unitXMLList dateTimeXMLList? "
    "expandedUncXMLList?",
    "expandedUncXMLList": "uncertaintyXMLList coverageFactorXMLList coverageProbabilityXMLList "
    "distributionXMLList?",
    "location": "(street|city|countryCode|further)+",
    "measuringEquipments": "measuringEquipment+",
    "measuringEquipment": "name equipmentClass* description? certificate? manufacturer? model? "
    "identifications?",
    "measurementMetaData": "metaData+",
    "metaData": "name? description? declaration?",
    **dict.fromkeys(("name", "description", "declaration", "further"), "content+"),
}
"""Children as in PTB's dcc.xsd 3.2.1 and SI_Format.xsd 2.1.0; unlisted elements have none.

Optional ones that we never write may be left out. `data`, `quantity` and `location` are choices of
which those that we write are listed.
"""

NOT_EMPTY = r"[^\s]+(\s+[^\s]+)*"
NUMBER = r"((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"
DAY = r"\d{4}-\d{2}-\d{2}"
TEXTS = {
    "release": NOT_EMPTY,
    "countryCodeISO3166_1": "[A-Z]{2}",
    "countryCode": "[A-Z]{2}",
    "usedLangCodeISO639_1": "[a-z]{2}",
    "mandatoryLangCodeISO639_1": "[a-z]{2}",
    "uniqueIdentifier": NOT_EMPTY,
    "street": NOT_EMPTY,
    "model": NOT_EMPTY,
    "role": NOT_EMPTY,
    "eMail": NOT_EMPTY,
    "phone": NOT_EMPTY,
    "convention": NOT_EMPTY,
    "norm": NOT_EMPTY,
    "calibrationLaboratoryCode": NOT_EMPTY,
    "issueDate": DAY,
    "beginPerformanceDate": DAY,
    "endPerformanceDate": DAY,
    "performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "city": NOT_EMPTY,
    "mainSigner": "true|false|1|0",
    "issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    "conformity": "pass|fail|conditionalPass|conditionalFail|noPass|noFail",
    "content": "(?s).*",
    "value": NOT_EMPTY,  # of an identification; that of si:real is a NUMBER as well
    "unit": r"\S+",
    "labelXMLList": r"\S+",
    "unitXMLList": r"\S+",
    "valueXMLList": f"[-+]?{NUMBER}",
    "uncertaintyXMLList": rf"\+?{NUMBER}",
    "coverageFactorXMLList": r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))",
    "coverageProbabilityXMLList": r"\+?((0(\.\d*)?)|(1(\.0*)?))",
}
"""Simple types of the same: what the text of an element, or each word of a list, must be."""


def wrong_children(element: ET.Element) -> list[str]:
    """Elements whose children are not those of `ORDER`."""
    name = element.tag.split("}")[1]
    children = [child.tag.split("}")[1] for child in element]
    pattern = "".join(
        f"(?:{word.rstrip('?*+').strip('()')} ){word[-1] if word[-1] in '?*+' else ''}"
        if "(" not in word
        else f"(?:(?:{word.rstrip('+').strip('()')}) ){'+' if word.endswith('+') else ''}"
        for word in ORDER.get(name, "").split()
    )
    good = re.fullmatch(pattern, "".join(f"{child} " for child in children))
    wrong = [] if good else [f"{name}: {children}"]
    return wrong + [found for child in element for found in wrong_children(child)]


def wrong_texts(element: ET.Element) -> list[str]:
    """Elements whose text is not that of `TEXTS`."""
    wrong = []
    for leaf in (e for e in element.iter() if not len(e)):
        name = leaf.tag.split("}")[1]
        words = (leaf.text or "").split(" ") if name.endswith("XMLList") else [leaf.text or ""]
        if not all(re.fullmatch(TEXTS[name], word) for word in words):
            wrong.append(f"{name}: {leaf.text}")
    return wrong


@pytest.fixture(scope="session")
def certificate(delivered: dict[str, Delivery]) -> ET.Element:
    return ET.fromstring(certificate_xml(passport(delivered["AT-SIM"], {}), DETAILS))


def test_with_every_key_it_has_the_same_order(delivered: dict[str, Delivery]) -> None:
    made = of(delivered["AT-SIM"], whole())
    details = made.delivery.unit.certificate
    assert details is not None
    root = ET.fromstring(certificate_xml(made, details))
    assert wrong_children(root) == []
    assert wrong_texts(root) == []


def test_elements_stand_in_the_documented_order(certificate: ET.Element) -> None:
    assert wrong_children(certificate) == []
    assert certificate.get("schemaVersion") == "3.2.1"


def test_texts_are_of_the_schema_s_simple_types(certificate: ET.Element) -> None:
    assert wrong_texts(certificate) == []
    real = certificate.find(f".//{{{SI}}}real/{{{SI}}}value")
    assert real is not None
    assert re.fullmatch(f"[-+]?{NUMBER}", real.text or "")
    lists = certificate.findall(f".//{{{SI}}}realListXMLList")
    assert len(lists) == 3
    for numbers in lists:
        for name in ("label", "value", "unit", "uncertainty", "coverageFactor"):
            assert len((numbers.findtext(f".//{{{SI}}}{name}XMLList") or "").split()) == 12
    broken = ET.fromstring(ET.tostring(certificate))
    factors = broken.find(f".//{{{SI}}}coverageFactorXMLList")
    assert factors is not None
    factors.text = "0.9"
    assert wrong_texts(broken) == ["coverageFactorXMLList: 0.9"]


def test_the_order_is_really_checked(certificate: ET.Element) -> None:
    broken = ET.fromstring(ET.tostring(certificate))
    core = broken.find(f".//{{{DCC}}}coreData")
    assert core is not None
    core[:] = core[::-1]
    (wrong,) = wrong_children(broken)
    assert wrong.startswith("coreData: ['performanceLocation'")


def test_certificate_has_si_values_and_uncertainties(
    certificate: ET.Element, delivered: dict[str, Delivery]
) -> None:
    p = passport(delivered["AT-SIM"], {})
    numbers = certificate.find(f".//{{{SI}}}realListXMLList")
    assert numbers is not None
    at_t0 = p.delivery.calibration.thermal.constants_at(20.0)
    scale = np.array([1 / 9.80665] * 9 + [1.0] * 3)

    def column(name: str) -> list[float]:
        text = numbers.findtext(f".//{{{SI}}}{name}")
        assert text is not None
        return [float(word) for word in text.split()]

    # Written with twelve digits.
    np.testing.assert_allclose(column("valueXMLList"), at_t0 * scale, rtol=1e-11)
    expanded = [b.expanded for b in p.constant_budgets]
    np.testing.assert_allclose(column("uncertaintyXMLList"), expanded * scale, rtol=1e-11)
    assert column("coverageProbabilityXMLList") == [0.95]
    names = certificate.findall(f".//{{{DCC}}}calibrationLaboratory//{{{DCC}}}content")
    assert [n.text for n in names] == ["Laboratory <A & B>"]


def test_certificate_is_delivered_only_when_people_said_who_they_are(
    delivered: dict[str, Delivery],
) -> None:
    delivery = delivered["AT-SIM"]
    assert CERTIFICATE not in all_files(delivery)
    signed = replace(delivery, unit=replace(delivery.unit, certificate=DETAILS))
    assert b"C-17" in all_files(signed)[CERTIFICATE]


TABLE = """
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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('city = "Kyiv"\n', "", "missing: [certificate] city (or leave [certificate] out)"),
        ('"UA"', '"Ukraine"', "[certificate] country: found 'Ukraine'; expected two capitals"),
        ("end = 2026-03-31", "end = 2026-03-29", "expected 2026-03-30 (begin) or later"),
        ("begin = 2026-03-30", 'begin = "2026-03-30"', "[certificate] begin: found '2026-03-30'"),
        ('"Maker"', '" "', "[certificate] manufacturer: found ' '; expected one line of text"),
        ('"Maker"', '"a\\nb"', "expected one line of text"),
    ],
)
def test_certificate_table_is_checked(tmp_path: Path, old: str, new: str, message: str) -> None:
    folder = tmp_path / "units" / "AT-SIM"
    shutil.copytree(UNITS / "AT-SIM", folder)
    path = folder / "unit.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text + TABLE, encoding="utf-8")
    details = read_unit(folder).certificate
    assert details is not None
    assert details.end == date(2026, 3, 31)
    path.write_text(text + TABLE.replace(old, new), encoding="utf-8")
    with pytest.raises(RefusedError, match=re.escape(message)):
        read_unit(folder)


# ---- A2L ----


def struct_words(delivery: Delivery) -> list[int]:
    """`triax_calib_t` as the words of its memory, every one an int32."""
    plan = delivery.plan
    words = [plan.temp_min_code, plan.temp_max_code]
    for segment in plan.segments:
        words += [segment.first_code, segment.origin_code, segment.gain]
        words += [int(c) for c in segment.coefficients.reshape(-1)]
    return words


@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
def test_each_characteristic_gives_the_planned_value(
    delivered: dict[str, Delivery], name: str
) -> None:
    delivery = delivered[name]
    plan, sensor = delivery.plan, delivery.unit.temperature_sensor
    memory = struct_words(delivery)
    words = calib_words(delivery.firmware)
    found = {w.name: w.method.slope * memory[w.offset // 4] + w.method.intercept for w in words}
    assert found["TRIAX_temp_min"] == sensor.degc(plan.temp_min_code)
    assert found["TRIAX_s0_origin"] == sensor.degc(plan.segments[0].origin_code)
    coefficients = [w for w in words if re.search(r"_\d+$", w.name)]
    assert len(coefficients) == plan.real.size
    flat = plan.real.reshape(-1, plan.shape.order + 1)
    for k, w in enumerate(coefficients):
        function, power = divmod(k, plan.shape.order + 1)
        exact = flat[function, power] * function_format(plan, function % 12)[1]
        # Rounded to the nearest integer: half a slope, and the rounding of the floats.
        assert abs(found[w.name] - exact) <= 0.5000001 * w.method.slope + 1e-12 * abs(exact)
    assert len({w.offset for w in words}) == len(words)


A2L_TOKEN = re.compile(r'"[^"]*"|/\*.*?\*/|/begin|/end|[^\s"]+', re.DOTALL)


def test_a2l_blocks_nest_and_refer_to_each_other(delivered: dict[str, Delivery]) -> None:
    delivery = delivered["AT-SIM"]
    text = calib_a2l(delivery.firmware).decode()
    assert text.isascii()
    tokens = [t for t in A2L_TOKEN.findall(text) if not t.startswith("/*")]
    stack, methods, used, symbols = [], set(), set(), []
    for i, token in enumerate(tokens):
        if token == "/begin":
            stack.append(tokens[i + 1])
            if tokens[i + 1] == "COMPU_METHOD":
                methods.add(tokens[i + 2])
            if tokens[i + 1] == "CHARACTERISTIC":
                kind, address, layout, _, method, low, high = tokens[i + 4 : i + 11]
                assert (kind, address, layout) == ("VALUE", "0x0", "TRIAX_INT32")
                assert float(low) < float(high)
                used.add(method)
                assert tokens[i + 11] == "SYMBOL_LINK"
                symbols.append((tokens[i + 12], int(tokens[i + 13])))
        if token == "/end":
            assert stack.pop() == tokens[i + 1]
    assert stack == []
    assert used == methods
    unit = f"{names_of(delivery.plan).linked}_{delivery.inputs_sha256[:8]}"
    assert {name for name, _ in symbols} == {f'"{unit}_calib_constants"'}
    assert [offset for _, offset in symbols] == [w.offset for w in calib_words(delivery.firmware)]


def test_another_parser_reads_the_a2l(delivered: dict[str, Delivery], tmp_path: Path) -> None:
    pya2l = pytest.importorskip("pya2l")
    from pya2l import model

    delivery = delivered["AT-SIM"]
    path = tmp_path / "triax_calib.a2l"
    path.write_bytes(calib_a2l(delivery.firmware))
    session = pya2l.import_a2l(str(path), in_memory=True, loglevel="ERROR")
    found = {c.name: c for c in session.query(model.Characteristic).all()}
    words = calib_words(delivery.firmware)
    assert set(found) == {w.name for w in words}
    for w in words:
        assert found[w.name].symbol_link.offset == w.offset
        assert found[w.name].conversion == w.method.name
    slopes = {m.name: m.coeffs_linear.a for m in session.query(model.CompuMethod).all()}
    assert slopes == {w.method.name: w.method.slope for w in words}
