"""What only people know of a calibration: [certificate] in unit.toml, for the DCC."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Table

CERTIFICATE_KEYS = (
    "identifier",
    "laboratory",
    "city",
    "country",
    "customer",
    "signer",
    "manufacturer",
    "begin",
    "end",
)


@dataclass(frozen=True)
class CertificateDetails:
    """Administrative data of a certificate.

    Attributes
    ----------
    identifier : str
        The certificate's own number.
    laboratory, city, customer, signer, manufacturer : str
    country : str
        Two capitals of ISO 3166-1.
    begin, end : date
        First and last day of the measurements.
    """

    identifier: str
    laboratory: str
    city: str
    country: str
    customer: str
    signer: str
    manufacturer: str
    begin: datetime.date
    end: datetime.date


def certificate_details(table: Table) -> CertificateDetails | None:
    """Details in a table [certificate]; None when it is empty.

    Raises
    ------
    RefusedError
        When some keys are there and others not, or a value is no text, country or date.
    """
    if not table.values:
        return None
    missing = [key for key in CERTIFICATE_KEYS if key not in table]
    if missing:
        raise RefusedError(
            table.where(missing[0]),
            "missing",
            expected=f"all of [certificate]: {', '.join(CERTIFICATE_KEYS)}",
            remedy="complete the table, or remove it: the certificate is then left out",
        )
    if not re.fullmatch("[A-Z]{2}", table.text("country")):
        raise table.refuse("country", 'two capitals of ISO 3166-1, as "UA"')
    begin, end = _date(table, "begin"), _date(table, "end")
    if end < begin:
        raise table.refuse("end", f"{begin} (begin) or later")
    texts = {key: _line(table, key) for key in CERTIFICATE_KEYS[:7]}
    return CertificateDetails(**texts, begin=begin, end=end)


def _line(table: Table, key: str) -> str:
    text = table.text(key)
    if not text.strip() or not text.isprintable():
        raise table.refuse(key, "one line of text")
    return " ".join(text.split())


def _date(table: Table, key: str) -> datetime.date:
    value = table.values[key]
    if isinstance(value, datetime.datetime) or not isinstance(value, datetime.date):
        raise table.refuse(key, "a date, as 2026-03-31")
    return value
