"""What only the laboratory knows of a calibration: [certificate] in unit.toml, for the DCC."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import DATE, line, pattern


@dataclass(frozen=True)
class CertificateDetails:
    """[certificate]: what only the laboratory knows, for the Digital Calibration Certificate.

    Attributes
    ----------
    identifier
        The certificate's own number.
    laboratory
        Who calibrated.
    city
        City of the laboratory.
    country
        Country of the laboratory.
    customer
        For whom.
    signer
        Who is responsible for the certificate.
    manufacturer
        Who made the unit.
    begin
        First day of the measurements.
    end
        Last day of the measurements.
    """

    identifier: str = setting(line(), example='"CAL-2026-001"')
    laboratory: str = setting(line(), example='"Inertial laboratory"')
    city: str = setting(line(), example='"Kyiv"')
    country: str = setting(pattern("[A-Z]{2}", 'two capitals of ISO 3166-1, as "UA"', '"UA"'))
    customer: str = setting(line(), example='"Customer"')
    signer: str = setting(line(), example='"A. Person"')
    manufacturer: str = setting(line(), example='"Manufacturer"')
    begin: datetime.date = setting(DATE, example="2026-03-30")
    end: datetime.date = setting(DATE, example="2026-03-31")


CERTIFICATE = TableKeys.of(CertificateDetails, optional=True)


def certificate_details(values: Values) -> CertificateDetails | None:
    """Details in a table [certificate]; None when there is none.

    Raises
    ------
    RefusedError
        When a value is no text, country or date, or the last day is before the first.
    """
    if not values:
        return None
    details = values.record(CertificateDetails)
    if details.end < details.begin:
        raise values.refuse("end", f"{details.begin} (begin) or later")
    return details
