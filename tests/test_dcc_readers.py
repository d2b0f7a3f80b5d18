"""The certificate read by programs of others: PyDCC, dsiUnits, xmlsec1; each skips where absent."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from dcc_cases import cert_of, cert_pem, key_of, pem
from test_stated import of, whole
from triaxcal.delivery.unit import Delivery
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.dcc.signature import sign
from triaxcal.report.passport.content import Passport


@pytest.fixture(scope="module")
def made(delivered: dict[str, Delivery]) -> Passport:
    return of(delivered["AT-SIM"], whole())


@pytest.fixture(scope="module")
def content(made: Passport) -> bytes:
    details = made.delivery.unit.certificate
    assert details is not None
    return certificate_xml(made, details)


def pydcc(monkeypatch: pytest.MonkeyPatch) -> Any:
    """PyDCC without two of its parts that reading does not need.

    Its package for paths of certificates stops on OpenSSL 3.0.10 and later. Its check against the
    schema asks the network at every start.
    """
    stands_in: Any = ModuleType("certvalidator")
    stands_in.CertificateValidator = stands_in.errors = stands_in.ValidationContext = None
    monkeypatch.setitem(sys.modules, "certvalidator", stands_in)
    found = pytest.importorskip("dcc")
    monkeypatch.setattr(found.dcc, "DCCXMLValidator", object)
    return found


@pytest.mark.filterwarnings("ignore")
def test_pydcc_reads_what_was_written(
    made: Passport, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = pydcc(monkeypatch).DCC(byte_array=content)
    assert found.is_loaded()
    assert found.version() == "3.2.1"
    assert found.uid() == "certificate, identifier <&> 0"
    assert found.calibration_laboratory_name() == "certificate, laboratory <&> 0"
    assert f"{found.calibration_date():%Y-%m-%d}" == "2026-04-07"
    results = found.get_calibration_results("name", "en")
    assert len(results) == 3
    at_t0 = made.delivery.calibration.thermal.constants_at(20.0)
    numbers = results[0][1]["realListXMLList"]
    values = np.array(numbers["valueXMLList"].split(), dtype=float)
    # Twelve digits are written.
    scale = np.array([1 / 9.80665] * 9 + [1.0] * 3)
    np.testing.assert_allclose(values, at_t0 * scale, rtol=1e-11)
    uncertainty = numbers["expandedUncXMLList"]["uncertaintyXMLList"].split()
    expanded = np.array([b.expanded for b in made.constant_budgets]) * scale
    np.testing.assert_allclose(np.array(uncertainty, dtype=float), expanded, rtol=1e-11)
    ids = found.item_id()["identifications"]["identification"]
    assert next(i["value"] for i in ids) == "AT-SIM-001"


@pytest.mark.filterwarnings("ignore")
def test_dsi_units_knows_every_unit(content: bytes) -> None:
    dsi = pytest.importorskip("dsi_unit")
    lists = re.findall(r"<si:unit(?:XMLList)?>([^<]*)<", content.decode())
    units = {word for words in lists for word in words.split()}
    from triaxcal.report.dcc import results

    units |= {u for _, pair in results._UNITS.values() for u in pair}
    units |= {results._PER_RATE, results._PER_ACCELERATION}
    assert {r"\percent", r"\hecto\pascal", r"\degreecelsius", r"\volt"} <= units
    for unit in units:
        assert dsi.DsiUnit(unit).valid, unit
    assert not dsi.DsiUnit(r"\volts").valid


@pytest.mark.parametrize("kind", ["rsa", "ec", "p521"])
def test_xmlsec_verifies_the_signature(content: bytes, tmp_path: Path, kind: str) -> None:
    pytest.importorskip("signxml")
    xmlsec = shutil.which("xmlsec1")
    if xmlsec is None:
        pytest.skip("no xmlsec1")
    root_key, key = key_of("ec"), key_of(kind)
    root = cert_of(root_key, "Root", ca=True)
    leaf = cert_of(key, issuer=(root, root_key))
    signed = sign(content, "c", ("key", pem(key)), ("cert", cert_pem(leaf)))
    (tmp_path / "root.pem").write_bytes(cert_pem(root))
    path = tmp_path / "signed.xml"
    command = [xmlsec, "--verify", "--trusted-pem", str(tmp_path / "root.pem")]
    for element in (
        "http://uri.etsi.org/01903/v1.3.2#:SignedProperties",
        "http://www.w3.org/2000/09/xmldsig#:KeyInfo",
    ):
        command += ["--id-attr:Id", element]
    for text, code in ((signed, 0), (signed.replace(b"2026-03-30", b"2026-03-29"), 1)):
        path.write_bytes(text)
        run = subprocess.run([*command, str(path)], capture_output=True, text=True, check=False)
        assert run.returncode == code, run.stderr
        assert ("References (ok/all): 3/3" in run.stderr + run.stdout) is (code == 0)
