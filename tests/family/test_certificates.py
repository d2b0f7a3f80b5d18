"""Certificates of every kind of unit against PTB's schema; after an update there is none."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from family_cases import COLUMNS, directions, log, write_unit
from test_face_words import unit_of as labelled_faces
from test_saved import TERMS, UNITS_OF
from test_scale_verdict import unit_of as wrong_scale
from test_update import recorded

import triaxcal
from builds import UNITS
from dcc_cases import faults
from test_stated import TABLES, value_of
from triaxcal.base.tomltext import toml_value
from triaxcal.delivery.unit import deliver
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.dcc.elements import SI
from triaxcal.report.passport.content import passport

pytestmark = pytest.mark.long


def not_shown(folder: Path) -> Path:
    """Its uncertainty reaches beyond a limit that its errors keep."""
    shutil.copytree(UNITS / "AT-SIM", folder)
    with (folder / "unit.toml").open("a", encoding="utf-8") as file:
        file.write("\n[limits]\nat_t0_g = 1.2e-5\nover_range_g = 2.5e-5\n")
    return folder


STATED = "".join(
    f"\n{table.header}\n"
    + "".join(f"{k.name} = {toml_value(value_of(table, k.name))}\n" for k in table.keys)
    for table in TABLES
)
KINDS: dict[str, Callable[[Path], Path]] = {
    "labelled faces": lambda f: labelled_faces(f, {}),
    "scale contradicts": lambda f: wrong_scale(f.parent, 0.5, "g"),
    "not shown": not_shown,
    **UNITS_OF,
    "recording": lambda f: write_unit(f, log(directions(20)), COLUMNS),
}


UNTESTED = {"faces"}
"""Of six poses of unknown direction none can be held out; labelled ones are all of a tilter."""


@pytest.mark.parametrize("kind", KINDS)
def test_the_certificate_of_each_kind_is_valid(kind: str, tmp_path: Path) -> None:
    folder = KINDS[kind](tmp_path / "U")
    path = folder / "unit.toml"
    path.write_text(path.read_text(encoding="utf-8") + STATED, encoding="utf-8")
    delivery = deliver(folder)
    made, details = passport(delivery, {}), delivery.unit.certificate
    assert details is not None
    if not made.tested:
        with pytest.raises(Exception, match="the constants are not tested"):
            certificate_xml(made, details)
        assert kind in UNTESTED
        return
    assert kind not in UNTESTED
    content = certificate_xml(made, details)
    assert faults(content) == ()
    good = content.count(b"<dcc:conformity>pass<")
    assert (good == len(made.acceptance)) is made.verdict.shown
    lists = ET.fromstring(content).findall(f".//{{{SI}}}realListXMLList")
    names = [(e.findtext(f"{{{SI}}}labelXMLList") or "").split() for e in lists]
    beyond = {"quadratic": "Q_x_xx", "rate": "rate_x"}.get(TERMS.get(kind, ""))
    assert [n[0] for n in names if len(n) != 12] == ([beyond] if beyond else [])
    for numbers, labels in zip(lists, names, strict=True):
        for child in ("valueXMLList", "unitXMLList"):
            assert len((numbers.findtext(f"{{{SI}}}{child}") or "").split()) == len(labels)
        values = (numbers.findtext(f"{{{SI}}}valueXMLList") or "").split()
        assert np.isfinite(np.array(values, dtype=float)).all()


def test_an_update_in_the_field_has_no_certificate_and_says_so(tmp_path: Path) -> None:
    """Number, dates and signer of unit.toml are of the calibration before it."""
    folder = write_unit(tmp_path / "units" / "U", log(directions(24)), COLUMNS)
    path = folder / "unit.toml"
    path.write_text(path.read_text(encoding="utf-8") + STATED, encoding="utf-8")
    done = triaxcal.deliver(folder, tmp_path / "build")
    assert "certificate.dcc.xml" in done.files
    again = triaxcal.update(folder, recorded(tmp_path, directions(6)), tmp_path / "build")
    assert "certificate.dcc.xml" not in again.files
    assert not (tmp_path / "build" / "U" / "certificate.dcc.xml").exists()
    document = json.loads((tmp_path / "build" / "U" / "passport.json").read_bytes())
    (caution,) = document["stated"]["cautions"]
    assert caution.startswith("what is stated here is of the calibration before the constants were")
    assert "there is no certificate of the update" in caution
