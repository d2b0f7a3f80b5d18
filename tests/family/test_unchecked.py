"""Calibrations that nothing checks are not called passed; certificates of recordings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import U0, K, directions, log, write_unit
from test_recordings import found

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.unit import deliver
from triaxcal.model.types import FloatArray
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.passport.content import passport
from triaxcal.report.passport.page import passport_html
from triaxcal.report.summary import summary


def exact(count: int) -> FloatArray:
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
    poses = directions(6) if count == 6 else tetrahedron
    return poses @ K.T + U0


def test_a_passport_does_not_deny_the_held_out_poses_of_its_head(tmp_path: Path) -> None:
    recording = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'
    readings = directions(14) @ K.T + U0
    made = passport(deliver(write_unit(tmp_path / "U", readings, recording, header="a,b,c")), {})
    page = passport_html(made).decode()
    assert "Held-out poses" in page
    assert "nothing was held out" not in page.lower()
    # One temperature: no curves over it; the limit is not called kept with all the uncertainty.
    assert "Constants over temperature" not in page
    assert "the whole uncertainty included" not in page
    assert "with what is known; not in it: the change with temperature" in page
    assert "m/s^2" not in page


def header_words(header: bytes) -> str:
    """The comment at the head of a C header, its lines as one."""
    return " ".join(header.decode().partition("*/")[0].replace("\n *", " ").split())


@pytest.mark.parametrize("count", [4, 6])
def test_what_no_pose_tests_is_not_called_passed(tmp_path: Path, count: int) -> None:
    recording = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'
    delivery = deliver(write_unit(tmp_path / "U", exact(count), recording, header="a,b,c"))
    made = passport(delivery, {})
    told = summary(made, ["a"], "build")
    words = "error and uncertainty (95 %) reach"
    assert made.verdict.words.startswith(f"not shown to be within the limits: {words}")
    assert made.verdict.words.endswith(" (limit 20 mg); nothing was held out")
    assert not made.verdict.passed
    assert made.verdict.words in " ".join(told.split())
    assert made.verdict.words in header_words(delivery.files["triax_calib.h"])
    assert "held out        none: no pose is determined by the others" in told
    assert "What the poses leave open gives" in told
    page = passport_html(made).decode()
    for reason in (*made.verdict.reasons, *made.verdict.not_tested):
        assert f">{reason[0].upper()}{reason[1:]}.<" in page
    # What is unknown is stated: cross terms of 10 mrad at least.
    assert made.component_budget.expanded > 0.015
    assert np.isfinite(delivery.calibration.constants_covariance(20.0)).all()


CERTIFICATE = """[certificate]
identifier = "C-1"
laboratory = "L"
city = "Kyiv"
country = "UA"
customer = "C"
signer = "S"
manufacturer = "M"
begin = 2026-03-30
end = 2026-03-31

"""


def test_a_recording_gets_its_certificate_in_its_own_units(tmp_path: Path) -> None:
    delivery = deliver(write_unit(tmp_path / "U", log(directions(12)), more=CERTIFICATE))
    made = passport(delivery, {})
    assert delivery.unit.certificate is not None
    text = certificate_xml(made, delivery.unit.certificate).decode()
    assert "12 poses, only |a| = g known; frame: sensor" in text
    assert r"\one \one \one \one \one \one \one \one \one \metre\second\tothe{-2}" in text
    values = re.findall(r"<si:valueXMLList>([^<]*)", text)[0].split()
    matrix, bias = found(delivery.calibration)
    expected = np.concatenate([matrix.ravel() / 9.80665, bias])
    # Twelve digits are printed.
    assert np.allclose(np.array(values, dtype=float), expected, rtol=1e-11)
    # Nothing is known of the change with temperature: no unconditional conformity.
    assert "not in it: the change with temperature" in text
    assert "conditionalPass" in text
    assert ">pass<" not in text


def test_a_certificate_of_what_nothing_checks_is_refused(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", log(directions(6)), more=CERTIFICATE)
    result = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "b")])
    assert isinstance(result.exception, RefusedError)
    assert "the constants are not tested: no pose could be held out" in str(result.exception)
    assert not (tmp_path / "b").exists()
