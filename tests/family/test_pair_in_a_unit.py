"""P3's coefficients by a key of unit.toml: taken off in the fit, and in the compiled C."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import U0, K, directions, log, write_unit
from test_recordings import calibrated, found, symmetric_part
from test_tables import AIR, HEADER, wide

from triaxcal.base.errors import RefusedError
from triaxcal.batch.plan import _order
from triaxcal.delivery.saved import calibration_json
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.pair.cross_coupling import terms_of_pair
from triaxcal.model.orientation import AIRCRAFT, gravity_direction
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray

KIP_A, KIP_B = 6e-4, -4e-4
MORE = '[quadratic]\ncross_coupling = "pair.csv"\naxes = ["x", "z"]\n'


def write_pair(folder: Path) -> None:
    """28 positions by exact sums; A reads KipA a b more, B KipB a b less."""
    theta = 5.0 + 13.0 * np.arange(28)
    phi = np.radians(theta)
    a_true, b_true = -np.cos(phi), np.sin(phi)
    a, b = a_true + KIP_A * a_true * b_true, b_true - KIP_B * a_true * b_true
    lines = [f"{t:g},{x:.12f},{y:.12f}" for t, x, y in zip(theta, a, b, strict=True)]
    (folder / "pair.csv").write_text("theta_deg,a_g,b_g\n" + "\n".join(lines) + "\n")


def coupled(force: FloatArray) -> FloatArray:
    """What outputs with the pair's cross-coupling in x and z see of forces (n, 3)."""
    product = force[:, 0] * force[:, 2]
    return force + np.stack([KIP_A * product, 0.0 * product, -KIP_B * product], axis=1)


def unit_with_pair(folder: Path, *arguments: object, **options: str) -> Path:
    write_unit(folder, *arguments, more=MORE, **options)  # type: ignore[arg-type]
    write_pair(folder)
    return folder


def test_poses_of_a_log_are_fitted_with_what_the_pair_says(tmp_path: Path) -> None:
    poses = coupled(directions(20))
    rows = log(poses, sd=0.002)
    folder = unit_with_pair(tmp_path / "U", rows)
    delivery = deliver(folder)
    calibration = delivery.calibration
    told = "cross-coupling of pair.csv is subtracted: KipA 0.0006"
    assert any(f.startswith(told) for f in calibration.findings)
    Q = calibration.terms.quadratic_per_g
    expected = terms_of_pair(KIP_A, KIP_B, (0, 2)).quadratic_per_g
    assert Q is not None
    assert expected is not None
    assert np.abs(Q - expected).max() < 1e-6  # squares of 6e-4
    matrix, bias = found(calibration)
    # As without a coupling: 0.017 mg a pose.
    assert np.abs(matrix - symmetric_part(K)).max() < 4e-4
    assert np.abs(bias - U0).max() < 4e-4
    assert calibration.recording is not None
    assert calibration.recording.rms_g < 0.02e-3
    assert b"quadratic_terms" in calibration_json(delivery)
    errors = [
        r.error_g for r in next(m for m in delivery.methods if m.method.name == "matrix").residuals
    ]
    rounding = 3 * 2.0**-17 / 9.8 + (delivery.bound.lsb + 1) * 2.0**-24
    assert np.abs(errors - calibration.recording.residual_g).max() < rounding
    plain = write_unit(tmp_path / "V", rows, more='[fit]\nterms = "linear"\n')
    without = calibrated(plain).recording
    assert without is not None
    assert (without.held_out_g or 0.0) > 3.0 * (calibration.recording.held_out_g or 1.0)


def test_poses_with_angles_too(tmp_path: Path) -> None:
    angles = wide()
    force = coupled(gravity_direction(AIRCRAFT, angles))
    rows = np.column_stack([np.degrees(angles), force @ K.T + U0])
    calibration = calibrated(unit_with_pair(tmp_path / "U", rows, AIR, header=HEADER))
    constants = calibration.thermal.constants_at(20.0)
    # Of second order in 6e-4: 4e-7, times 9.8 and a few.
    assert np.abs(constants - np.concatenate([K.ravel(), U0])).max() < 2e-5
    Q = calibration.terms.quadratic_per_g
    assert Q is not None
    seen = products(np.eye(3) + 0.5) @ Q.T
    assert np.abs(seen[:, 1]).max() < 1e-9


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            '[quadratic]\naxes = ["x", "y"]\n',
            "missing: [quadratic] cross_coupling (or leave [quadratic] out)",
        ),
        (
            '[quadratic]\ncross_coupling = "pair.csv"\n',
            "missing: [quadratic] axes (or leave [quadratic] out)",
        ),
        (MORE.replace('"z"', '"x"'), 'expected the axes that A and B are, as ["x", "y"]'),
        (MORE.replace("pair.csv", "../pair.csv"), "expected a file in the unit's folder"),
        (MORE, "pair.csv: cannot be read: no such file or directory"),
    ],
)
def test_a_wrong_pair_is_refused(tmp_path: Path, more: str, told: str) -> None:
    folder = write_unit(tmp_path / "U", log(directions(12)), more=more)
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    assert told in str(refusal.value)


def test_a_series_takes_the_pair_along(tmp_path: Path) -> None:
    """A worker elsewhere needs the file, and a pair measured anew makes the unit anew."""
    folder = unit_with_pair(tmp_path / "U", log(directions(12)))
    order = _order(folder, "toolchain")
    assert set(order.files) == {"unit.toml", "log.csv", "pair.csv"}
    (folder / "pair.csv").write_text((folder / "pair.csv").read_text() + "\n")
    assert _order(folder, "toolchain").key != order.key
