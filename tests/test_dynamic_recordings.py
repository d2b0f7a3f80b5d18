"""Hand rotations of real units, of mikoff (MPU-9150) and imucal, against what they publish."""

from __future__ import annotations

import numpy as np
import pytest

from dynamic_cases import recording_of
from recordings import recording
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.dynamic.survey import survey

RATE_HZ = 100.0
GYRO_SCALE_PERCENT = (
    (0.041, 0.457, 0.826),
    (0.007, 0.260, -0.179),
    (-0.058, 0.277, 0.242),
    (0.227, 0.599, 0.308),
    (0.226, 0.570, 0.853),
)
GYRO_BIAS_DEG_PER_S = (
    (1.146, -0.401, 1.261),
    (-0.573, 1.089, 0.286),
    (0.573, -0.344, 1.261),
    (-1.261, 1.031, 4.813),
    (-1.031, 0.401, 1.432),
)
ACCEL_BIAS = (
    (0.103, 0.097, 0.344),
    (0.090, 0.070, 0.338),
    (0.096, 0.008, -0.045),
    (0.065, 0.092, -0.009),
    (0.070, 0.036, 0.182),
)
ROUNDED_DEG_PER_S = np.degrees(0.0005)
"""Every printed gyro bias is a whole number of 0.001 rad/s."""


@pytest.mark.parametrize(
    "unit", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 5))]
)
def test_hand_rotations_give_the_published_constants(unit: int) -> None:
    table = np.loadtxt(recording("mikoff_mpu9150") / f"imu{unit}.log")
    samples = ImuSamples(np.arange(len(table)) / RATE_HZ, table[:, 3:].copy(), table[:, :3].copy())
    sd = table[:600].std(axis=0)
    noise = DataSheet(
        float(np.degrees(sd[3:].max() / np.sqrt(RATE_HZ)) * 60),
        float(sd[:3].max() / np.sqrt(RATE_HZ) / 9.80665e-6),
    )
    # Latitude and gravity of the place are not stated. The Earth's rate is a hundredth of these
    # gyros' deviations; gravity is common to the three accelerometer scale factors, not compared.
    about = {"rate_hz": RATE_HZ, "latitude_deg": 55.7, "gravity_m_per_s2": 9.8155}
    result = calibrate_dynamic(recording_of(samples, f"imu{unit}", **about), noise)
    layout = result.layout
    assert result.heading_rad is None  # they cannot see the north, and it is not made up

    def compare(name: str, places: list[int], published: np.ndarray, rounding: float) -> None:
        place = layout.place(name)
        found, deviation = result.p[place][places], result.sd[place][places]
        assert np.all(np.abs(found - published) < 3 * deviation + rounding), (name, found)

    compare("gyro-matrix", [0, 4, 8], np.array(GYRO_SCALE_PERCENT[unit]) / 100, 5e-6)
    rounding = float(np.radians(ROUNDED_DEG_PER_S))
    compare("gyro-bias", [0, 1, 2], np.radians(GYRO_BIAS_DEG_PER_S[unit]), rounding)
    compare("accelerometer-bias", [0, 1, 2], np.array(ACCEL_BIAS[unit]), 5e-4)


IMUCAL_RATE_HZ = 102.4
IMUCAL_REST = {(0, 1): (540, 1271), (0, -1): (1620, 2361), (1, 1): (2814, 3298),
               (1, -1): (3740, 4152), (2, 1): (4522, 4975), (2, -1): (5376, 5983)}  # fmt: skip
IMUCAL_TURNS = ((6770, 7093), (8081, 8405), (9205, 9512))
HAND_DEG = 2.0
"""A turn by hand against an edge comes back to where it began within so much."""
CLOSES_DEG = 0.13
"""Between two rests gravity turns as the gyros say within so much: 0.05 to 0.2 deg in this session,
at up to 800 deg/s and 102.4 Hz. It is no noise of rest, and so stated as angle random walk."""


@pytest.mark.slow
def test_hand_turns_of_imucal_agree_with_its_own_evaluation() -> None:
    """Six rests and a turn by 360 deg about each axis (Ferraris), sections as its list has them.

    The gyros' scale factors by the turns are as good as the turns; gravity tells them here.
    """
    table = np.loadtxt(
        recording("imucal") / "example_ferraris_session.csv", delimiter=",", skiprows=1
    )
    rate, force = np.radians(table[:, 1:4]), table[:, 4:7]
    rest = IMUCAL_REST[0, 1]
    start = 420  # it is put down before
    sd = [values[slice(*rest)].std(axis=0).max() for values in (rate, force)]
    root = np.sqrt(IMUCAL_RATE_HZ)
    assert np.degrees(sd[0] / root) < CLOSES_DEG / 10
    noise = DataSheet(CLOSES_DEG * 60, float(sd[1] / root / 9.80665e-6))
    samples = ImuSamples(
        np.arange(len(table) - start) / IMUCAL_RATE_HZ, rate[start:], force[start:]
    )
    about = {"rate_hz": IMUCAL_RATE_HZ, "latitude_deg": 49.6, "gravity_m_per_s2": 9.81}
    result = calibrate_dynamic(recording_of(samples, "imucal", **about), noise)
    bias = rate[slice(*rest)].mean(axis=0)
    theta = result.p[result.layout.place("gyro-matrix")].reshape(3, 3)
    found = result.p[result.layout.place("accelerometer-bias")]
    for axis, section in enumerate(IMUCAL_TURNS):
        turned = np.degrees(np.sum((rate[slice(*section)] - bias)[:, axis])) / IMUCAL_RATE_HZ
        sd_deg = 360.0 * result.sd[result.layout.place("gyro-matrix")][4 * axis]
        assert abs(abs(turned) - 360.0 * (1 + theta[axis, axis])) < HAND_DEG + 3 * sd_deg
        ends = [force[slice(*IMUCAL_REST[axis, sign])].mean(axis=0)[axis] for sign in (1, -1)]
        # The half-sum takes the unit as level in both: cosines of 2 deg are 6 mm/s^2.
        assert abs(sum(ends) / 2 - found[axis]) < 9.81 * (1 - np.cos(np.radians(HAND_DEG)))


def test_labelled_parts_in_one_file_are_no_other_axes_and_no_other_clock() -> None:
    """Between its parts imucal's annotated file has no rows."""
    lines = (recording("imucal") / "annotated_session.csv").read_text().splitlines()[1:]
    table = np.array([line.split(",")[2:] for line in lines], dtype=float)
    force, rate = table[:, :3] / 2048 * 9.80665, np.radians(table[:, 3:] / 16.4)
    samples = ImuSamples(np.arange(len(table)) / 204.8, rate, force)
    about = {"rate_hz": 204.8, "latitude_deg": 49.6, "gravity_m_per_s2": 9.8087}
    with pytest.raises(RefusedError, match=r"the gyros explain \d+ % of how it turns"):
        survey(recording_of(samples, "annotated", **about))
