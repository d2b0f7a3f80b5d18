"""What only the laboratory knows of a calibration: [certificate] in unit.toml."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import DATE, line, pattern, word

PLACES = ("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
"""Where a calibration may be performed, in the words of the Digital Calibration Certificate."""
_LONGEST = 200
"""Of a text, so that it fits a page, and the certificate's number its code to scan.

The other keys of version 0.1.0 keep theirs of any length."""


@dataclass(frozen=True, kw_only=True)
class CertificateDetails:
    """[certificate]: who calibrated the unit for whom, for the Digital Calibration Certificate.

    Attributes
    ----------
    identifier
        The certificate's own number.
    issued
        Day on which the certificate is issued.
    laboratory
        Who calibrated.
    laboratory_address
        Street and number, or post box, of the laboratory.
    city
        City of the laboratory.
    country
        Country of the laboratory.
    laboratory_contact
        E-mail address or telephone number of the laboratory.
    accreditation
        Number of the laboratory's accreditation, and the body that gave it.
    customer
        For whom.
    customer_address
        Address of the customer.
    manufacturer
        Who made the unit.
    model
        The manufacturer's name of the type.
    begin
        First day of the measurements.
    end
        Last day of the measurements.
    performed_at
        Where the calibration was performed: laboratory and customer, or a branch of either.
    signer
        Who is responsible for the certificate.
    signer_role
        Role of the signer in the laboratory.
    second_signer
        Who signs besides.
    second_signer_role
        Role of the second signer.
    """

    identifier: str = setting(line(_LONGEST), example='"CAL-2026-001"')
    issued: datetime.date | None = setting(DATE, None, example="2026-04-02")
    laboratory: str = setting(line(), example='"Inertial laboratory"')
    laboratory_address: str | None = setting(line(_LONGEST), None, example='"1 Street"')
    city: str = setting(line(), example='"Kyiv"')
    country: str = setting(pattern("[A-Z]{2}", 'two capitals of ISO 3166-1, as "UA"', '"UA"'))
    laboratory_contact: str | None = setting(line(_LONGEST), None, example='"lab@example.org"')
    accreditation: str | None = setting(line(_LONGEST), None, example='"Body, number 1234"')
    customer: str = setting(line(), example='"Customer"')
    customer_address: str | None = setting(line(_LONGEST), None, example='"2 Street, 10000 City"')
    manufacturer: str = setting(line(), example='"Manufacturer"')
    model: str | None = setting(line(_LONGEST), None, example='"Type 1"')
    begin: datetime.date = setting(DATE, example="2026-03-30")
    end: datetime.date = setting(DATE, example="2026-03-31")
    performed_at: str = setting(word(PLACES), "laboratory")
    signer: str = setting(line(), example='"A. Person"')
    signer_role: str | None = setting(line(_LONGEST), None, example='"head of the laboratory"')
    second_signer: str | None = setting(line(_LONGEST), None, example='"B. Person"')
    second_signer_role: str | None = setting(line(_LONGEST), None, example='"technician"')


CERTIFICATE = TableKeys.of(CertificateDetails, optional=True)


def certificate_details(values: Values) -> CertificateDetails | None:
    """Details in a table [certificate]; None when there is none.

    Raises
    ------
    RefusedError
        When a value is no text, country or date; the last day is before the first, or the day of
        issue before the last day; a role has no person.
    """
    if not values:
        return None
    details = values.record(CertificateDetails)
    if details.end < details.begin:
        raise values.refuse("end", f"{details.begin} (begin) or later")
    if details.issued is not None and details.issued < details.end:
        raise values.refuse("issued", f"{details.end} (end) or later")
    if details.second_signer is None and details.second_signer_role is not None:
        raise values.refuse(
            "second_signer_role", "second_signer beside it", "state the person, or remove the role"
        )
    return details
