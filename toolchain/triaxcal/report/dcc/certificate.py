"""certificate.dcc.xml: PTB's Digital Calibration Certificate, schema 3.2.1 with D-SI 2.1.0.

Values are in SI units: K in V/(m/s^2), U0 in V; of a recording in its own unit of the readings
(counts have the unit one, g are turned into m/s^2). Customer, dates and
signer are in [certificate] of unit.toml; without it there is no certificate.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

from triaxcal.base.errors import RefusedError
from triaxcal.report.dcc.administrative import administrative_data
from triaxcal.report.dcc.elements import DCC, SCHEMA, SI, XSI
from triaxcal.report.dcc.results import measurement_results
from triaxcal.report.passport.content import Passport
from triaxcal.unit.certificate import CertificateDetails


def certificate_xml(p: Passport, details: CertificateDetails) -> bytes:
    """The certificate; without a clock, so equal inputs give equal bytes.

    Raises
    ------
    RefusedError
        When nothing that the fit did not use has tested the constants, or a text has a character
        that XML cannot hold.
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
    administrative_data(root, p, details)
    measurement_results(root, p)
    ET.indent(root, " ")
    body: str = ET.tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()
