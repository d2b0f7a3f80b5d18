"""Which terms go into the C of a recording: by held-out poses, or as [firmware] says."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from family_cases import directions, write_unit
from test_recordings import calibrated

from coverage_devices import shares
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import fit_folder
from triaxcal.delivery.judgement import judge
from triaxcal.fitting.core.judged import ORIENTATION, TEMPERATURE, HeldOutPoses
from triaxcal.fitting.recorded.acceptance import refuse_poses_beyond_limits
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS
from triaxcal.unit.description import read_unit

ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "g"'
OWN = np.array([4e-3, -5e-3, 3e-3])
SCALE, BIAS = np.array([1.003, 0.996, 1.001]), np.array([0.02, -0.03, 0.01])


def readings(own: FloatArray, count: int = 30, sd: float = 3e-4, seed: int = 5) -> FloatArray:
    Q = np.zeros((3, 6))
    Q[np.arange(3), np.arange(3)] = own
    force = directions(count, seed=seed)
    linear = force
    for _ in range(20):
        linear = force - products(linear) @ Q.T
    noise = sd * np.random.default_rng(seed).standard_normal((count, 3))
    result: FloatArray = linear * SCALE + BIAS + noise
    return result


def unit(tmp_path: Path, own: FloatArray, more: str = "") -> Path:
    return write_unit(tmp_path / "U", readings(own), ROWS, header="a,b,c", more=more)


def test_squares_that_matter_are_in_the_c_and_near_the_truth(tmp_path: Path) -> None:
    calibration = calibrated(unit(tmp_path, OWN))
    Q = calibration.terms.quadratic_per_g
    assert Q is not None
    assert re.search(
        r"own squares are in the C: the poses are [\de+. a-z]+ times as probable with them "
        r"\(needed: \d+ times as probable with them\); largest effect [\d.]+ mg at 1 g, where the "
        r"standard uncertainty is [\d.]+ mg; held-out error [\d.]+ mg with them, [\d.]+ mg "
        r"without$",
        calibration.selection_reason,
    )
    shares = {s.name: s for s in (calibration.recording.shares if calibration.recording else ())}
    found = np.array([shares[f"Q{a}.{a}{a}"].value for a in "xyz"])
    sd = np.array([shares[f"Q{a}.{a}{a}"].sd for a in "xyz"])
    assert np.abs((found - OWN) / sd).max() < 4.0
    assert all(shares[f"Q{a}.{a}{a}"].data > 0.9 for a in "xyz")


def test_no_squares_are_left_out_with_the_numbers_of_the_rule(tmp_path: Path) -> None:
    calibration = calibrated(unit(tmp_path, np.zeros(3)))
    assert calibration.terms.quadratic_per_g is None
    told = calibration.selection_reason
    assert re.search(
        r"left out of the C: the poses are [\d.]+ times as probable without them", told
    )
    assert "where the standard uncertainty is " in told


@pytest.mark.parametrize("seed", range(6))
def test_few_or_noisy_poses_do_not_put_squares_into_the_c(tmp_path: Path, seed: int) -> None:
    """Ten good poses and twenty bad ones of devices without squares: a false alarm is one in ten.

    A device with odds of 10 for squares that it has not is rarer than 1 in 10; none of the twelve
    here, by their seeds.
    """
    for count, sd in ((10, 2e-4), (20, 5e-3)):
        rows = readings(np.zeros(3), count, sd, seed=50 + seed)
        folder = write_unit(tmp_path / f"U{count}", rows, ROWS, header="a,b,c")
        assert calibrated(folder).terms.quadratic_per_g is None


@pytest.mark.parametrize("terms", ["linear", "own-squares", "quadratic"])
def test_a_series_states_its_terms(tmp_path: Path, terms: str) -> None:
    calibration = calibrated(unit(tmp_path, OWN, f'[firmware]\nterms = "{terms}"\n'))
    Q = calibration.terms.quadratic_per_g
    if terms == "linear":
        assert Q is None
        return
    assert Q is not None
    own = Q[np.arange(3), np.arange(3)].copy()
    assert (own != 0.0).all()
    Q = Q.copy()
    Q[np.arange(3), np.arange(3)] = 0.0
    assert Q.any() == (terms == "quadratic")


def test_terms_that_are_left_out_stand_in_the_uncertainty(tmp_path: Path) -> None:
    folder = unit(tmp_path, OWN, '[firmware]\nterms = "linear"\n')
    done = fit_folder(read_unit(folder), folder)
    found = uncertainty(done.unit, done.measurements, done.calibration, None, np.array([20.0]))
    left_out = next(s for s in found.sources if s.key == "left_out_terms")
    linear = DIRECTIONS
    Q = np.zeros((3, 6))
    Q[np.arange(3), np.arange(3)] = OWN
    for _ in range(20):
        linear = DIRECTIONS - products(linear) @ Q.T
    seen = linear * SCALE + BIAS
    constants = done.calibration.thermal.constants_at(20.0)[None]
    error = float(np.abs(force_from_voltage(constants, seen) - DIRECTIONS).max())
    # What the linear constants miss is the squares; the noise of the poses adds some of 1 mg.
    assert left_out.sd == pytest.approx(error, abs=1.2e-3)


def test_intervals_with_terms_left_out_hold_what_they_say() -> None:
    """A device's components stand together: of ten devices the share of 95 % is known to 3.5 %."""
    found = shares(range(10), 24, squares=True, stated='[firmware]\nterms = "linear"\n')
    assert found["component"] > 0.85
    assert found["C"] > 0.85


def test_terms_that_are_not_fitted_cannot_be_stated(tmp_path: Path) -> None:
    more = '[fit]\nterms = "linear"\n[firmware]\nterms = "quadratic"\n'
    with pytest.raises(RefusedError, match=r"\[firmware\] terms: \"quadratic\" with \[fit\] terms"):
        calibrated(unit(tmp_path, OWN, more))


def test_a_held_out_error_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    folder = unit(tmp_path, np.zeros(3))
    done = fit_folder(read_unit(folder), folder)
    recording = done.calibration.recording
    assert recording is not None
    refuse_poses_beyond_limits(done.unit, done.calibration)
    pose = recording.poses.poses[4]
    for what in (ORIENTATION, TEMPERATURE):
        worse = replace(recording, held_out=(HeldOutPoses(what, (3, 4), np.array([0.001, 0.6])),))
        with pytest.raises(RefusedError, match="mg rms at held-out poses, with each") as caught:
            refuse_poses_beyond_limits(done.unit, replace(done.calibration, recording=worse))
        assert caught.value.place.endswith(f", line {pose.line}")
        assert f"{what} held out in turn; the largest is 600 mg in pose {pose.number}" in str(
            caught.value
        )


def test_a_component_beyond_the_limit_at_held_out_poses_is_refused(tmp_path: Path) -> None:
    """Stated directions 2 deg off, at random: |a| cannot show 35 mg across gravity."""
    random = np.random.default_rng(3)
    stated = np.cross(DIRECTIONS, random.standard_normal(DIRECTIONS.shape))
    stated = DIRECTIONS + np.radians(2.0) * stated / np.linalg.norm(stated, axis=1, keepdims=True)
    stated /= np.linalg.norm(stated, axis=1, keepdims=True)
    keys = (
        'rows = "poses"\nacceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"\n'
        'direction = ["dx", "dy", "dz"]'
    )
    readings = DIRECTIONS * 9.80665 + 1e-3 * random.standard_normal(DIRECTIONS.shape)
    header = "ax,ay,az,dx,dy,dz"
    sound = write_unit(tmp_path / "S", np.hstack([readings, DIRECTIONS]), keys, header=header)
    folder = write_unit(tmp_path / "U", np.hstack([readings, stated]), keys, header=header)
    done = fit_folder(read_unit(sound), sound)
    refuse_poses_beyond_limits(done.unit, done.calibration)
    found = judge(done)
    (component,) = [t for t in found.tested if t.what == "held out, a component"]
    assert component.rms
    # 1 mm/s^2 of noise a component, a little more with the constants of the other poses.
    assert 0.8e-4 < component.largest_g < 2e-4
    wrong = fit_folder(read_unit(folder), folder)
    with pytest.raises(RefusedError) as caught:
        refuse_poses_beyond_limits(wrong.unit, wrong.calibration)
    text = str(caught.value)
    assert "a component of the force is off by" in text
    assert "expected at most 20 mg (limits.at_t0_g)" in text
    assert "check the stated angles or directions of that pose" in text
