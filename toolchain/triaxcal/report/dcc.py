"""certificate.dcc.xml: PTB's Digital Calibration Certificate, schema 3.2.1 with D-SI 2.1.0.

Values are in SI units: K in V/(m/s^2), U0 in V; of a recording in its own unit of the readings
(counts have the unit one, g are turned into m/s^2). Customer, dates and
signer are in [certificate] of unit.toml; without it there is no certificate.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import numpy as np

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.report.passport.content import Passport
from triaxcal.report.words.device import device_words
from triaxcal.uncertainty.coverage import LEVEL
from triaxcal.unit.certificate import CertificateDetails
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
XSI = "http://www.w3.org/2001/XMLSchema-instance"
SCHEMA = "3.2.1"
_VOLT = (r"\volt\second\tothe{2}\metre\tothe{-1}", r"\volt")
_ACCELERATION = (r"\one", r"\metre\second\tothe{-2}")
_COUNT = (r"\second\tothe{2}\metre\tothe{-1}", r"\one")
_UNITS = {
    "V": (1.0, _VOLT),
    "mV": (1e-3, _VOLT),
    "count": (1.0, _COUNT),
    "m/s^2": (1.0, _ACCELERATION),
    "g": (STANDARD_GRAVITY_M_PER_S2, _ACCELERATION),
    "mg": (1e-3 * STANDARD_GRAVITY_M_PER_S2, _ACCELERATION),
}
"""Unit of the readings in SI units, and the units of K and U0 then."""


def certificate_xml(p: Passport, details: CertificateDetails) -> bytes:
    """The certificate; without a clock, so equal inputs give equal bytes.

    Raises
    ------
    RefusedError
        When nothing that the fit did not use has tested the constants.
    """
    if not p.tested:
        raise RefusedError(
            f"{p.delivery.unit.source}, [certificate]",
            "the constants are not tested: no pose could be held out",
            expected="poses that the others determine",
            remedy="record more poses, or remove the table",
        )
    for prefix, uri in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
        ET.register_namespace(prefix, uri)
    root = ET.Element(f"{{{DCC}}}digitalCalibrationCertificate", {"schemaVersion": SCHEMA})
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} {DCC}/v{SCHEMA}/dcc.xsd")
    _administrative_data(root, p, details)
    _measurement_results(root, p)
    ET.indent(root, " ")
    body: str = ET.tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()


def _add(parent: ET.Element, name: str, text: str | None = None, **attributes: str) -> ET.Element:
    element = ET.SubElement(parent, f"{{{DCC}}}{name}", attributes)
    element.text = text
    return element


def _text(parent: ET.Element, name: str, text: str) -> ET.Element:
    """Element of DCC's textType or richContentType in English."""
    element = _add(parent, name)
    _add(element, "content", text, lang="en")
    return element


def _administrative_data(root: ET.Element, p: Passport, details: CertificateDetails) -> None:
    data = _add(root, "administrativeData")
    software = _add(_add(data, "dccSoftware"), "software")
    _text(software, "name", "triaxcal")
    _add(software, "release", __version__)
    core = _add(data, "coreData")
    _add(core, "countryCodeISO3166_1", details.country)
    _add(core, "usedLangCodeISO639_1", "en")
    _add(core, "mandatoryLangCodeISO639_1", "en")
    _add(core, "uniqueIdentifier", details.identifier)
    _add(core, "beginPerformanceDate", details.begin.isoformat())
    _add(core, "endPerformanceDate", details.end.isoformat())
    _add(core, "performanceLocation", "laboratory")
    _item(data, p, details)
    laboratory = _contact(_add(data, "calibrationLaboratory"), details.laboratory)
    location = _add(laboratory, "location")
    _add(location, "city", details.city)
    _add(location, "countryCode", details.country)
    person = _add(_add(data, "respPersons"), "respPerson")
    _text(_add(person, "person"), "name", details.signer)
    _add(person, "mainSigner", "true")
    customer = _add(data, "customer")
    _text(customer, "name", details.customer)
    _text(_add(customer, "location"), "further", details.customer)
    _statements(data, p)


def _contact(parent: ET.Element, name: str) -> ET.Element:
    contact = _add(parent, "contact")
    _text(contact, "name", name)
    return contact


def _item(data: ET.Element, p: Passport, details: CertificateDetails) -> None:
    item = _add(_add(data, "items"), "item")
    _text(item, "name", "triaxial accelerometer")
    _text(_add(item, "manufacturer"), "name", details.manufacturer)
    identification = _add(_add(item, "identifications"), "identification")
    _add(identification, "issuer", "manufacturer")
    _add(identification, "value", p.delivery.unit.serial)
    _text(identification, "name", "serial number")


def _statements(data: ET.Element, p: Passport) -> None:
    """Conformity with the unit's limits, the uncertainty included."""
    statements = _add(data, "statements")
    for limit in p.acceptance:
        statement = _add(statements, "statement")
        _text(statement, "name", f"| |a| - g | {limit.where}, at most {limit.limit_g:g} g")
        unknown = "".join(f"; not in it: {line.source.name}" for line in p.length_budget.unknown)
        found = (
            f"largest at the dwells {limit.largest_g:.3g} g, expanded uncertainty of |a| "
            f"{limit.uncertainty_g:.3g} g ({LEVEL:.0%}), main source {limit.cause}{unknown}"
            f"{''.join(f'; {words}' for words in p.verdict.not_tested)}"
        )
        _text(statement, "declaration", found)
        whole = limit.shown and not unknown and not p.verdict.not_tested
        _add(statement, "conformity", "pass" if whole else "conditionalPass")
    if p.verified_device is not None:
        statement = _add(statements, "statement")
        _text(statement, "name", "compensated output of the device itself at check positions")
        _text(statement, "declaration", device_words(p.verified_device))
        _add(statement, "conformity", "pass")


def _measurement_results(root: ET.Element, p: Passport) -> None:
    result = _add(_add(root, "measurementResults"), "measurementResult")
    _text(result, "name", "constants of a triaxial accelerometer over temperature")
    method = _add(_add(result, "usedMethods"), "usedMethod")
    recording = p.delivery.calibration.recording
    tilter = "six positions of a tilter in a thermal chamber"
    poses = "" if recording is None else f"{len(recording.poses.poses)} poses, {recording.route}"
    _text(method, "name", poses or tilter)
    _text(
        method,
        "description",
        "a = K^-1 (U - U0). K_ij is the output of axis i for unit acceleration along axis j, U0_i "
        "the bias of axis i. Uncertainty by JCGM 100:2008." + _beyond(p),
    )
    software = _add(_add(result, "usedSoftware"), "software")
    _text(software, "name", "triaxcal")
    _add(software, "release", __version__)
    _gravity(result, p)
    results = _add(result, "results")
    for temp in (p.uncertainty.t0_index, 0, len(p.uncertainty.temps_degc) - 1):
        _constants(results, p, temp)


def _beyond(p: Passport) -> str:
    """What the constants alone do not say."""
    terms = p.delivery.calibration.terms
    if terms.quadratic_per_g is None:
        return ""
    return " The result l is made a = l + Q p(l) by quadratic terms that calibration.json holds."


def _gravity(result: ET.Element, p: Passport) -> None:
    condition = _add(_add(result, "influenceConditions"), "influenceCondition")
    _text(condition, "name", "local gravity")
    quantity = _add(_add(condition, "data"), "quantity")
    real = ET.SubElement(quantity, f"{{{SI}}}real")
    value = p.delivery.unit.gravity_g * STANDARD_GRAVITY_M_PER_S2
    ET.SubElement(real, f"{{{SI}}}value").text = f"{value:.9g}"
    ET.SubElement(real, f"{{{SI}}}unit").text = r"\metre\second\tothe{-2}"


def _constants(results: ET.Element, p: Passport, temp: int) -> None:
    temp_degc = float(p.uncertainty.temps_degc[temp])
    values = p.delivery.calibration.thermal.constants_at(temp_degc)
    budgets = [p.uncertainty.constant_budget(c, temp) for c in range(12)]
    result = _add(results, "result")
    _text(result, "name", f"constants at {temp_degc:g} degrees Celsius")
    quantity = _add(_add(result, "data"), "quantity")
    _text(quantity, "name", ", ".join(CONSTANT_NAMES))
    numbers = ET.SubElement(quantity, f"{{{SI}}}realListXMLList")
    size, (of_gain, of_bias) = _UNITS[p.delivery.calibration.reading_unit]
    scale = size * np.array([1.0 / STANDARD_GRAVITY_M_PER_S2] * 9 + [1.0] * 3)
    _si(numbers, "labelXMLList", CONSTANT_NAMES)
    _si(numbers, "valueXMLList", _decimals(values * scale))
    _si(numbers, "unitXMLList", [of_gain] * 9 + [of_bias] * 3)
    expanded = ET.SubElement(numbers, f"{{{SI}}}expandedUncXMLList")
    found = np.array([b.expanded for b in budgets]) * scale
    _si(expanded, "uncertaintyXMLList", _decimals(found))
    _si(expanded, "coverageFactorXMLList", [f"{b.factor:.3f}" for b in budgets])
    _si(expanded, "coverageProbabilityXMLList", [f"{LEVEL:g}"])


def _si(parent: ET.Element, name: str, words: Iterable[str]) -> None:
    ET.SubElement(parent, f"{{{SI}}}{name}").text = " ".join(words)


def _decimals(values: FloatArray) -> list[str]:
    return [f"{value:.12g}" for value in values.tolist()]
