"""What only people know of a calibration: [certificate] in unit.toml, for the DCC."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, key, keys_of
from triaxcal.base.kinds import DATE, line, pattern


@dataclass(frozen=True)
class CertificateDetails:
    """Administrative data of a certificate."""

    identifier: str = key(line(), "The certificate's own number.", example='"CAL-2026-001"')
    laboratory: str = key(line(), "Who calibrated.", example='"Inertial laboratory"')
    city: str = key(line(), "City of the laboratory.", example='"Kyiv"')
    country: str = key(
        pattern("[A-Z]{2}", 'two capitals of ISO 3166-1, as "UA"', '"UA"'),
        "Country of the laboratory.",
    )
    customer: str = key(line(), "For whom.", example='"Customer"')
    signer: str = key(line(), "Who is responsible for the certificate.", example='"A. Person"')
    manufacturer: str = key(line(), "Who made the unit.", example='"Manufacturer"')
    begin: datetime.date = key(DATE, "First day of the measurements.", example="2026-03-30")
    end: datetime.date = key(DATE, "Last day of the measurements.", example="2026-03-31")


CERTIFICATE = TableKeys(
    "certificate",
    "What only people know, for the Digital Calibration Certificate.",
    keys_of(CertificateDetails),
    optional=True,
)


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
