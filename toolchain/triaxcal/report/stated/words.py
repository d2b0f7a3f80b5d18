"""What a laboratory states, in words."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from triaxcal.report.stated.statements import (
    NO_CERTIFICATE,
    NO_DAY,
    NO_EQUIPMENT,
    NOT_TRACEABLE,
    OVERDUE,
    UPDATED,
    Caution,
    Value,
)
from triaxcal.unit.limits import Limits

LABELS: Mapping[str, str] = MappingProxyType(
    {
        "certificate.identifier": "Certificate number",
        "certificate.laboratory": "Laboratory",
        "certificate.city": "City",
        "certificate.country": "Country",
        "certificate.customer": "Customer",
        "certificate.signer": "Responsible",
        "certificate.manufacturer": "Manufacturer of the unit",
        "certificate.begin": "First day of the measurements",
        "certificate.end": "Last day of the measurements",
        "certificate.issued": "Issued",
        "certificate.laboratory_address": "Address of the laboratory",
        "certificate.laboratory_contact": "Contact of the laboratory",
        "certificate.accreditation": "Accreditation",
        "certificate.customer_address": "Address of the customer",
        "certificate.signer_role": "Role of the responsible person",
        "certificate.second_signer": "Second signer",
        "certificate.second_signer_role": "Role of the second signer",
        "certificate.model": "Model of the unit",
        "certificate.performed_at": "Performed at",
        "measured.rig": "Rig",
        "measured.date": "Day of the measurements",
        "measured.place": "Place",
        "measured.operator": "Measured by",
        "measured.ambient_degc": "Temperature of the room",
        "measured.humidity_percent": "Relative humidity",
        "measured.pressure_hpa": "Air pressure",
        "equipment.name": "Equipment",
        "equipment.manufacturer": "Manufacturer",
        "equipment.model": "Model",
        "equipment.serial": "Serial number",
        "equipment.certificate": "Certificate",
        "equipment.calibrated": "Calibrated",
        "equipment.due": "Due",
        "equipment.traceable_to": "Traceable to",
    }
)
"""Of every key, as a form has it."""


def value_words(value: Value | None, unit: str) -> str:
    """A value with its unit."""
    if value is None:
        return "not stated"
    if isinstance(value, tuple):
        low, high = value
        words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    else:
        words = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{words} {unit}".strip()


def added_words(limits: Limits) -> str:
    """What the decision rule adds to an error; "" for nothing."""
    if not limits.rule.guarded:
        return ""
    return "uncertainty" if limits.guard_band_g is None else "guard band"


_CAUTIONS = {
    OVERDUE: "{subject}: its calibration was due on {dates[0]}, before the last day of the "
    "measurements, {dates[1]}",
    NO_CERTIFICATE: "{subject}: number or day of its calibration certificate is not stated, so its "
    "traceability is not shown",
    NOT_TRACEABLE: "{subject}: to what its calibration is traceable is not stated",
    NO_EQUIPMENT: "no equipment is stated, so traceability is not shown",
    UPDATED: "what is stated here is of the calibration before the constants were brought up to "
    "date in the field; there is no certificate of the update",
    NO_DAY: "no day of the measurements is stated, so the dates of the equipment were not compared "
    "with it",
}


def caution_words(caution: Caution) -> str:
    """A caution as a sentence without its full stop."""
    return _CAUTIONS[caution.kind].format(subject=caution.subject, dates=caution.dates)
