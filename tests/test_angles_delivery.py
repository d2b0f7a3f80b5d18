"""A unit whose device makes angles: files, the API, what the passport says of their uncertainty."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.unit import Delivery
from triaxcal.fixedpoint.angles import STATUS_NOT_AT_REST
from triaxcal.model.orientation import angles_from_force, gravity_direction
from triaxcal.uncertainty.angles import angle_uncertainty
from triaxcal.uncertainty.orientation import affine_of
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE, AnglesChoice
from triaxcal.unit.description import read_unit

UNITS = Path(__file__).parents[1] / "units"
ARCSEC = np.degrees(1.0) * 3600.0


def unit_with(folder: Path, text: str) -> Path:
    shutil.copytree(UNITS / "AT-SIM", folder / "ANGLES")
    toml = folder / "ANGLES" / "unit.toml"
    toml.write_text(toml.read_text() + f"\n[firmware]\n{text}\n")
    return folder / "ANGLES"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('angles = "zenith"', 'one of "none", "zenith-tool-face", "pitch-roll"'),
        ('angles = "pitch-roll"\nrest_within_g = 1.5', "rest_within_g"),
        ('angles = "pitch-roll"\nsecond_angle_from_deg = 0', "second_angle_from_deg"),
    ],
)
def test_wrong_keys_are_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=message):
        read_unit(unit_with(tmp_path, text))


def test_no_angles_where_none_are_asked_for(delivered: dict[str, Delivery]) -> None:
    assert read_unit(UNITS / "AT-SIM").angles is None
    assert not [name for name in delivered["AT-SIM"].files if "angles" in name]
    cal = triaxcal.fit(triaxcal.read_unit(UNITS / "AT-SIM"))
    with pytest.raises(RefusedError, match="unit AT-SIM states none"):
        triaxcal.firmware(cal).angles([[0, 0, 1]])


@pytest.mark.parametrize("pair", [ZENITH_TOOL_FACE, PITCH_ROLL])
def test_uncertainty_is_that_of_errors_drawn_from_the_sources(
    pair: str, delivered: dict[str, Delivery]
) -> None:
    """Errors of D from the covariances of all sources, at T0, through the angles themselves."""
    u, choice = delivered["AT-SIM"].firmware.uncertainty, AnglesChoice(pair)
    found = angle_uncertainty(u, choice)
    rng = np.random.default_rng(5)
    row = int(np.argmin(np.abs(found.first_deg - 40.0)))
    grid = np.array([[found.first_deg[row], s] for s in np.arange(0.0, 360.0, 5.0)])
    force = gravity_direction(choice.kind, np.radians(grid))
    away = np.zeros((1500, len(grid), 2))
    for source in u.sources:
        if source.force is None:
            continue
        covariance = source.force[u.t0_index]
        D = rng.multivariate_normal(np.zeros(len(covariance)), covariance, 1500, method="svd")
        D = D.reshape(1500, 3, -1)
        error = np.einsum("sij,gj->sgi", D, affine_of(force, D.shape[2]))
        turned = angles_from_force(choice.kind, force + error) - np.radians(grid)
        away += (turned + np.pi) % (2.0 * np.pi) - np.pi
    sd = away.std(axis=0) * ARCSEC
    across = np.hypot(force[:, 1], force[:, 2 if pair == PITCH_ROLL else 0])
    drawn = sd.max(axis=0)[0], (sd[:, 1] * across).max()
    # The alignment of the tilter dominates, with 8 degrees of freedom: k = 2.31. A standard
    # deviation of 1500 draws is within 2 %, the largest of 72 up to 5 % high.
    for expanded, one in zip(found.at_t0[row], drawn, strict=True):
        assert 2.31 / 1.08 < expanded / one < 2.31 * 1.04
    assert (found.over_range >= found.at_t0).all()


def test_sensitivities_are_slopes_of_the_angles(delivered: dict[str, Delivery]) -> None:
    u = delivered["AT-SIM"].firmware.uncertainty
    found = angle_uncertainty(u, AnglesChoice(ZENITH_TOOL_FACE))
    at_90 = int(np.argmin(np.abs(found.first_deg - 90.0)))
    # At a zenith of 90 deg, 1 mg along z turns it by 1 mrad; of scale only what z reads: nothing.
    assert found.per_offset[at_90, 0, 2] == pytest.approx(ARCSEC * 1e-3)
    assert found.per_scale[at_90, 0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    at_45 = int(np.argmin(np.abs(found.first_deg - 45.0)))
    assert found.per_scale[at_45, 0, 2] == pytest.approx(ARCSEC * 1e-3 / 2.0)
    assert found.per_offset[:, 1, 2] == pytest.approx(0.0)


@pytest.mark.long
def test_a_delivery_with_angles(tmp_path: Path, delivered: dict[str, Delivery]) -> None:
    folder = unit_with(tmp_path, 'angles = "zenith-tool-face"\nprefix = "north"')
    done = triaxcal.deliver(folder, tmp_path / "build")
    names = {p.name for p in done.folder.iterdir()}
    assert {"north_angles.h", "north_angles.c"} <= names
    plain = delivered["AT-SIM"].files
    for name in ("comp.h", "comp.c"):
        text = (done.folder / f"north_{name}").read_text()
        theirs = plain[f"triax_{name}"].decode()
        assert (
            text.replace("north", "triax").replace("NORTH", "TRIAX").split("*/", 1)[1]
            == (theirs.split("*/", 1)[1])
        )
    checked = json.loads((done.folder / "verification.json").read_text())["angles"]
    assert [e["angle"] for e in checked["errors"]] == ["zenith", "tool face"]
    for error in checked["errors"]:
        assert error["largest_seen_units"] <= error["bound_units"]
        assert error["bound_arcsec"] < 0.05
    passport = json.loads((done.folder / "passport.json").read_text())["angles"]
    # The tilter's alignment: some 45 arcsec in every direction.
    assert 30.0 < max(row[0] for row in passport["expanded_uncertainty_over_range_arcsec"]) < 60.0
    page = (done.folder / "passport.html").read_text()
    assert "Angles of the device" in page
    fw = triaxcal.firmware(triaxcal.load(done.folder / "calibration.json"))
    accel, _ = fw.apply([[0, 0, 1500000], [100, 2000000, 1500000]], 2560)
    angle, status = fw.angles([*accel.tolist(), [0, 0, 0]])
    assert angle.dtype == np.uint32
    assert status[2] & STATUS_NOT_AT_REST
    with fw.compiled() as c:
        found = c.angles([*accel.tolist(), [0, 0, 0]])
    assert np.array_equal(found[0], angle)
    assert np.array_equal(found[1], status)
    # Without the key the folder is made anew, and has no angles.
    toml = folder / "unit.toml"
    toml.write_text(toml.read_text().replace("zenith-tool-face", "none"))
    again = triaxcal.deliver(folder, tmp_path / "build")
    assert not [p for p in again.folder.iterdir() if "angles" in p.name]
