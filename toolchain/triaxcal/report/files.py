"""All files of a delivery: the firmware's, the results, passport and certificate."""

from __future__ import annotations

from triaxcal.codegen.names import names_of
from triaxcal.delivery.saved import calibration_json
from triaxcal.delivery.unit import Delivery
from triaxcal.report.a2l import calib_a2l
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.report.pictures.residual_plot import residuals_svg
from triaxcal.report.results import verification_json

CERTIFICATE = "certificate.dcc.xml"
SOMETIMES = (
    CERTIFICATE, "*_comp.h", "*_comp.c", "*_calib.h", "*_calib.c", "*_selftest.h", "*_selftest.c",
    "*_angles.h", "*_angles.c",
    "*_calib.bin", "*_calib.a2l", "passport.*.html",
)  # fmt: skip
"""Files that an earlier delivery may have had besides; the prefix may have been another."""


def passport_files(made: Passport) -> dict[str, bytes]:
    """The passport as a page in each of the unit's languages, and as JSON."""
    first, *others = made.languages
    pages = {"passport.html": passport_html(made, first)}
    pages |= {f"passport.{code}.html": passport_html(made, code) for code in others}
    return {**pages, "passport.json": passport_json(made)}


def all_files(delivery: Delivery, made: Passport | None = None) -> dict[str, bytes]:
    """Name and content of everything that build/<UNIT>/ receives.

    `made` is the delivery's passport, if there is one already.
    """
    unit_passport = made or passport(delivery, {})
    certificate = {}
    details = delivery.unit.certificate
    # Number and dates of a certificate are those of the calibration before an update in the field.
    if details is not None and delivery.calibration.update is None:
        from triaxcal.report.dcc.certificate import certificate_xml  # noqa: PLC0415  XML only when needed

        certificate[CERTIFICATE] = certificate_xml(unit_passport, details)
    return {
        **delivery.files,
        "calibration.json": calibration_json(delivery, delivery.firmware.functions),
        "verification.json": verification_json(delivery),
        "residuals.svg": residuals_svg(delivery),
        **passport_files(unit_passport),
        names_of(delivery.plan).file("triax_calib.a2l"): calib_a2l(delivery.firmware),
        **certificate,
    }
