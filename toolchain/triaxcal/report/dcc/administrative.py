"""Administrative data of the certificate: who, what, when, for whom, and the statements."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from triaxcal import __version__
from triaxcal.device.record import sha256_of
from triaxcal.report.dcc.elements import contact, element, identification, text
from triaxcal.report.passport.content import Acceptance, Passport
from triaxcal.report.stated.words import caution_words
from triaxcal.report.words.device import device_words
from triaxcal.uncertainty.coverage import LEVEL
from triaxcal.unit.certificate import CertificateDetails
from triaxcal.unit.decision import GUIDE

_LANGUAGE = "en"


def administrative_data(root: ET.Element, p: Passport, details: CertificateDetails) -> None:
    """First ring of the certificate."""
    data = element(root, "administrativeData")
    software(element(data, "dccSoftware"))
    _core_data(data, details)
    _item(data, p, details)
    _laboratory(data, details)
    _persons(data, p, details)
    customer = contact(data, "customer", details.customer)
    address = details.customer_address or "address not stated"
    text(element(customer, "location"), "further", address)
    _statements(data, p)


def software(parent: ET.Element) -> None:
    """Triaxcal in a list of software."""
    made = element(parent, "software")
    text(made, "name", "triaxcal")
    element(made, "release", __version__)


def _core_data(data: ET.Element, details: CertificateDetails) -> None:
    core = element(data, "coreData")
    element(core, "countryCodeISO3166_1", details.country)
    element(core, "usedLangCodeISO639_1", _LANGUAGE)
    element(core, "mandatoryLangCodeISO639_1", _LANGUAGE)
    element(core, "uniqueIdentifier", details.identifier)
    element(core, "beginPerformanceDate", details.begin.isoformat())
    element(core, "endPerformanceDate", details.end.isoformat())
    element(core, "performanceLocation", details.performed_at)
    if details.issued is not None:
        element(core, "issueDate", details.issued.isoformat())


def _item(data: ET.Element, p: Passport, details: CertificateDetails) -> None:
    item = element(element(data, "items"), "item")
    text(item, "name", "triaxial accelerometer")
    contact(item, "manufacturer", details.manufacturer)
    if details.model is not None:
        element(item, "model", details.model)
    known = element(item, "identifications")
    identification(known, "manufacturer", p.delivery.unit.serial, "serial number")
    name = "SHA-256 of the calibration image for the unit's flash"
    identification(known, "calibrationLaboratory", sha256_of(p.image), name)


def _laboratory(data: ET.Element, details: CertificateDetails) -> None:
    laboratory = element(data, "calibrationLaboratory")
    if details.accreditation is not None:
        element(laboratory, "calibrationLaboratoryCode", details.accreditation)
    made = contact(laboratory, "contact", details.laboratory)
    if details.laboratory_contact is not None:
        kind = "eMail" if "@" in details.laboratory_contact else "phone"
        element(made, kind, details.laboratory_contact)
    location = element(made, "location")
    if details.laboratory_address is not None:
        element(location, "street", details.laboratory_address)
    element(location, "city", details.city)
    element(location, "countryCode", details.country)


def _persons(data: ET.Element, p: Passport, details: CertificateDetails) -> None:
    persons = element(data, "respPersons")
    _person(persons, details.signer, details.signer_role, main=True)
    if details.second_signer is not None:
        _person(persons, details.second_signer, details.second_signer_role, main=False)
    if p.delivery.unit.measured.operator is not None:
        _person(persons, p.delivery.unit.measured.operator, "measured the unit", main=False)


def _person(persons: ET.Element, name: str, role: str | None, *, main: bool) -> None:
    made = element(persons, "respPerson")
    contact(made, "person", name)
    if role is not None:
        element(made, "role", role)
    element(made, "mainSigner", "true" if main else "false")


def _statements(data: ET.Element, p: Passport) -> None:
    """Conformity by the decision rule, what was tested and what not, and what limits trust."""
    statements = element(data, "statements")
    for limit in p.acceptance:
        _conformity(statements, p, limit)
    tested = "; ".join(str(t) for t in p.verdict.tested)
    _statement(statements, "what was held against the limits", tested)
    untested = "; ".join(p.verdict.not_tested) or "everything that the limits ask for was tested"
    _statement(statements, "what was not tested", untested)
    for caution in p.cautions:
        _statement(statements, "stated by the laboratory, with a caution", caution_words(caution))
    if p.verified_device is not None:
        name = "compensated output of the device itself at check positions"
        _statement(statements, name, device_words(p.verified_device), "pass")


def _conformity(statements: ET.Element, p: Passport, limit: Acceptance) -> None:
    """Conformity with one of the unit's limits."""
    limits = p.delivery.unit.limits
    unknown = [line.source.name for line in p.length_budget.unknown if limits.rule.guarded]
    words = [
        (
            f"largest at the dwells {limit.largest_g:.3g} g, expanded uncertainty of |a| "
            f"{limit.uncertainty_g:.3g} g ({LEVEL:.0%}), main source {limit.cause}"
        ),
        f"guard band w {limit.guard_g:.3g} g, acceptance limit {limit.acceptance_g:.3g} g",
        *(f"not in it: {name}" for name in unknown),
        *p.verdict.contradicts,
        *p.verdict.not_tested,
    ]
    statement = element(statements, "statement")
    text(statement, "name", f"| |a| - g | {limit.where}, at most {limit.limit_g:g} g")
    element(statement, "convention", limits.rule_words)
    element(statement, "norm", GUIDE)
    text(statement, "declaration", "; ".join(words))
    open_points = [*unknown, *p.verdict.not_tested, *p.verdict.contradicts]
    whole = limit.shown and not open_points
    element(statement, "conformity", "pass" if whole else "conditionalPass")


def _statement(parent: ET.Element, name: str, words: str, conformity: str = "") -> None:
    statement = element(parent, "statement")
    text(statement, "name", name)
    text(statement, "declaration", words)
    if conformity:
        element(statement, "conformity", conformity)
