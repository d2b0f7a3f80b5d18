"""Poses with a table's angles, from the file to the calibration, and the pair's command."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from family_cases import U0, K, write_unit
from test_recordings import calibrated

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.route import calibrate_recording
from triaxcal.fitting.table.calibrate import _angle_residuals
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.orientation import AIRCRAFT, INCLINOMETER, gravity_direction
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance
from triaxcal.unit.description import read_unit
from triaxcal.unit.recording import Angles

ARCSEC = np.pi / 180.0 / 3600.0
QUADRATIC = np.array([[1, -1, 0, 1, 0, 0], [0, 1, -1, 0, 0, 1], [0, 0, 0, 0, 1, 0]])
"""Shape of a Q, by the products of `model.terms`."""
AIR = (
    'rows = "poses"\nacceleration = ["ux", "uy", "uz"]\nacceleration_unit = "m/s^2"\n'
    'pitch = "pitch"\nroll = "roll"\nangle_unit = "deg"'
)


def wide() -> FloatArray:
    """Pitch of five values by roll all round, in rad: every product of the axes is seen."""
    pitch = np.radians([-60.0, -30.0, 0.0, 30.0, 60.0])
    roll = np.radians(np.arange(0.0, 360.0, 45.0))
    return np.stack(np.meshgrid(pitch, roll, indexing="ij"), axis=-1).reshape(-1, 2)


def table(kind: str = AIRCRAFT, *, turn: bool = False) -> FloatArray:
    """Angles in rad: P0's 25 positions, or full turns of both angles."""
    if turn:
        steps = np.radians(np.arange(0.0, 360.0, 30.0))
        roll = np.stack([np.zeros(12), steps], axis=1)
        pitch = np.stack([np.radians(np.arange(-75.0, 76.0, 15.0)), np.full(11, np.pi / 2)], axis=1)
        return np.concatenate([roll, pitch])
    steps = np.radians(np.arange(-30.0, 31.0, 15.0))
    if kind == INCLINOMETER:
        zenith, face = (
            np.radians([20.0, 50.0, 80.0, 110.0]),
            np.radians(np.arange(0.0, 360.0, 45.0)),
        )
        return np.stack(np.meshgrid(zenith, face, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


def rows_of(
    angles: FloatArray, kind: str = AIRCRAFT, *, error_arcsec: float = 4.0, quadratic: float = 0.0
) -> FloatArray:
    """Angles in degrees and readings at angles that are off by the table's error."""
    random = np.random.default_rng(2)
    off = error_arcsec * ARCSEC * random.standard_normal(angles.shape)
    force = gravity_direction(kind, angles + off)
    Q = quadratic * QUADRATIC
    readings = (force + products(force) @ Q.T) @ K.T + U0
    return np.column_stack([np.degrees(angles), readings])


HEADER = "pitch,roll,ux,uy,uz"


def test_p0s_grid_gives_the_truth_and_refuses_quadratic_terms(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", rows_of(table()), AIR, header=HEADER)
    calibration = calibrated(folder)
    constants = calibration.thermal.constants_at(20.0)
    sd = np.sqrt(np.diag(calibration.constants_covariance(20.0)))
    truth = np.concatenate([K.ravel(), U0])
    assert np.abs((constants - truth) / sd).max() < 4.5
    assert calibration.recording is not None
    # 4 arcsec are 19 micro-g; the best of the table is linear.
    assert 10e-6 < calibration.recording.rms_g < 30e-6
    chosen = next(c for c in calibration.candidates if c.chosen)
    assert "quadratic" not in chosen.label
    scores = {c.label: c.held_out_g for c in calibration.candidates if c.held_out_g is not None}
    assert min(scores, key=lambda label: scores[label]) in {
        "linear, force from readings",
        "linear, readings from force",
    }
    assert any("angles back from the readings: pitch" in f for f in calibration.recording.findings)


def test_the_tables_budget_stands_beside_what_is_left(tmp_path: Path) -> None:
    more = "[uncertainty]\nrepeatability_arcsec = 4\n"
    folder = write_unit(tmp_path / "U", rows_of(table()), AIR, header=HEADER, more=more)
    found = calibrated(folder).recording
    assert found is not None
    told = next(f for f in found.findings if f.startswith("table: 4 arcsec an angle, 0 arcsec"))
    # 4 arcsec are 19.4 micro-g along the slope: cosines and three components make 15.
    assert "of level are 15" in told
    assert told.endswith("consistent")


def test_a_quadratic_truth_is_found_where_it_is(tmp_path: Path) -> None:
    rows = rows_of(wide(), quadratic=3e-4)
    calibration = calibrated(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    scores = {c.label: c.held_out_g or 1.0 for c in calibration.candidates}
    assert min(scores, key=lambda label: scores[label]).startswith("quadratic")
    assert min(scores.values()) < 0.2 * scores["linear, readings from force"]


def test_what_is_stated_with_quadratic_terms_is_the_scatter_of_many(tmp_path: Path) -> None:
    """14 poses, 30 unknowns: K, U0 and the force over 80 sensors against what is stated of them.

    The products are drawn from their priors, for the part of them that no pose at 1 g can show (the
    squares sum to a constant) is stated by the priors. Each ratio of variances is of 80 draws, 0.16
    of it.
    """
    count, draws = 14, 80
    k = np.arange(count) + 0.5
    pitch = np.arcsin(1.0 - 2.0 * k / count)
    angles = np.stack([pitch, np.remainder(np.pi * (1.0 + np.sqrt(5.0)) * k, 2.0 * np.pi)], axis=1)
    force = gravity_direction(AIRCRAFT, angles)
    truth = np.concatenate([K.ravel(), U0])
    own = np.eye(3, 6, dtype=np.bool_)
    errors, stated, force_errors, force_stated = [], [], [], []
    for seed in range(draws):
        random = np.random.default_rng(seed)
        Q = np.where(own, 1e-3, 3e-4) * random.standard_normal((3, 6))
        noise = 1e-4 * random.standard_normal((count, 3))
        rows = np.column_stack([np.degrees(angles), inverse(force, Q) @ K.T + U0 + noise])
        more = '[fit]\nterms = "quadratic"\n[priors]\nown_square_g_per_g2 = 1e-3\n'
        folder = write_unit(tmp_path / str(seed), rows, AIR, header=HEADER, more=more)
        unit = read_unit(folder)
        assert unit.recording is not None
        unit, measurements, calibration = calibrate_recording(unit, unit.recording, folder)
        constants = calibration.thermal.constants_at(20.0)
        errors.append(constants - truth)
        stated.append(np.diag(calibration.constants_covariance(20.0)))
        sources = uncertainty(unit, measurements, calibration, None, np.array([20.0])).sources
        poses = next(s for s in sources if s.key == "poses").force
        assert poses is not None
        force_stated.append(force_variance(poses, DIRECTIONS)[0, :, :3])
        exact = inverse(DIRECTIONS, Q) @ K.T + U0
        seen = calibration.terms.force_g(force_from_voltage(constants, exact))
        force_errors.append(seen - DIRECTIONS)
    for found, said in ((errors, stated), (force_errors, force_stated)):
        ratio = np.mean(np.square(found), axis=0) / np.mean(said, axis=0)
        assert np.abs(ratio - 1.0).max() < 5.0 * np.sqrt(2.0 / draws)


def inverse(force: FloatArray, Q: FloatArray) -> FloatArray:
    """The l of a = l + Q p(l), to the last digit."""
    linear = force
    for _ in range(8):
        linear = force - products(linear) @ Q.T
    return linear


def test_quadratic_terms_reach_the_compiled_c(tmp_path: Path) -> None:
    rows = rows_of(wide(), quadratic=3e-4)
    delivery = deliver(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    assert delivery.calibration.terms.quadratic_per_g is not None
    errors = [
        r.error_g for r in next(m for m in delivery.methods if m.method.name == "matrix").residuals
    ]
    assert delivery.calibration.recording is not None
    # Rounding: raw codes of 2^-16 m/s^2 in three axes, the proven bound, the output.
    rounding = 3 * 2.0**-17 / 9.8 + (delivery.bound.lsb + 1) * 2.0**-24
    assert np.abs(errors - delivery.calibration.recording.residual_g).max() < rounding
    assert np.abs(errors).max() < 60e-6  # the table's 4 arcsec; the linear model leaves 300


def test_terms_that_no_pose_shows_are_not_offered(tmp_path: Path) -> None:
    """Turns about two angles alone never have x and z together."""
    rows = rows_of(table(turn=True), quadratic=3e-4)
    calibration = calibrated(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    quadratic = [c for c in calibration.candidates if c.label.startswith("quadratic")]
    assert [c.held_out_g for c in quadratic] == [None, None]
    assert all((c.condition or 0.0) > 100.0 for c in quadratic)


def test_inclinometer_angles_and_a_recording_end_in_c(tmp_path: Path) -> None:
    recording = AIR.replace("pitch", "zenith").replace("roll", "tool_face")
    rows = rows_of(table(INCLINOMETER), INCLINOMETER)
    folder = write_unit(tmp_path / "U", rows, recording, header="zenith,tool_face,ux,uy,uz")
    delivery = deliver(folder)
    constants = delivery.calibration.thermal.constants_at(20.0)
    # 20 micro-g of placement in 32 positions: some 1e-4 m/s^2.
    assert np.abs(constants - np.concatenate([K.ravel(), U0])).max() < 5e-4
    assert delivery.check.total > 10**6


def test_full_turns_are_told(tmp_path: Path) -> None:
    rows = rows_of(table(turn=True))
    calibration = calibrated(write_unit(tmp_path / "U", rows, AIR, header=HEADER))
    assert calibration.recording is not None
    turns = [
        f for f in calibration.recording.findings if f.startswith("full turn of roll (13 poses)")
    ]
    assert len(turns) == 1


@pytest.mark.parametrize(
    ("azimuth_error", "told"),
    [
        (0.0, "the residuals do not depend on azimuth"),
        (60.0, "check (b): the table's plane is out of level by 5"),
    ],
)
def test_azimuth_tells_a_table_out_of_level(
    tmp_path: Path, azimuth_error: float, told: str
) -> None:
    """The plumb line turned by exact rotation, the azimuth running round.

    Of 60 arcsec the biases take a few: the azimuths of 48 poses do not cancel in each.
    """
    from triaxcal.model.orientation import direction_cosines

    random = np.random.default_rng(3)
    angles = np.stack(
        [*random.uniform(-1.2, 1.2, (2, 48)), np.radians(np.arange(0.0, 360.0, 7.5))], axis=1
    )
    e = azimuth_error * ARCSEC
    plumb = np.array([np.sin(e), 0.0, np.cos(e)])
    off = angles + 2.0 * ARCSEC * random.standard_normal(angles.shape)
    readings = direction_cosines(AIRCRAFT, off) @ plumb @ K.T + U0
    rows = np.column_stack([np.degrees(angles), readings])
    recording = AIR + '\nyaw = "yaw"'
    folder = write_unit(tmp_path / "U", rows, recording, header="pitch,roll,yaw,ux,uy,uz")
    calibration = calibrated(folder)
    assert calibration.recording is not None
    assert any(told in f for f in calibration.recording.findings), calibration.recording.findings


GOOD = rows_of(table(turn=True))
REFUSED = {
    "degrees-for-radians": (
        GOOD,
        AIR.replace('"deg"', '"rad"'),
        'degrees taken for radians? then angle_unit = "deg"',
    ),
    "radians-for-degrees": (
        np.column_stack([np.radians(GOOD[:, :2]), GOOD[:, 2:]]),
        AIR,
        'radians taken for degrees? then angle_unit = "rad"',
    ),
    "left-handed": (
        GOOD * [1, 1, -1, 1, 1],
        AIR,
        "x along -x, y along +y, z along +z of the table; expected x, y, z along x, y, z, or all",
    ),
    "exchanged": (
        GOOD[:, [0, 1, 3, 2, 4]],
        AIR,
        "the sensing axes lie x along +y, y along +x, z along +z of the table",
    ),
    "too-few": (GOOD[:5], AIR, "5 poses with angles; expected at least 6"),
    "one-angle-only": (
        rows_of(np.stack([np.zeros(12), np.radians(np.arange(0.0, 360.0, 30.0))], axis=1)),
        AIR,
        "do not determine all constants (condition number",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_tables_are_named_with_what_to_do(tmp_path: Path, name: str) -> None:
    rows, recording, told = REFUSED[name]
    folder = write_unit(tmp_path / "U", rows, recording, header=HEADER)
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    assert told in str(refusal.value)


def test_all_signs_turned_is_the_convention_of_the_sensor(tmp_path: Path) -> None:
    """A sensor that reads gravity instead of specific force: K stays positive, as read."""
    plain = calibrated(write_unit(tmp_path / "A", GOOD, AIR, header=HEADER))
    other = calibrated(write_unit(tmp_path / "B", GOOD * [1, 1, -1, -1, -1], AIR, header=HEADER))
    first, second = (c.thermal.constants_at(20.0) for c in (plain, other))
    assert np.abs(first[:9] - second[:9]).max() < 1e-12 * 10
    assert np.abs(first[9:] + second[9:]).max() < 1e-12 * 10


TEMPS = (-20.0, 0.0, 20.0, 40.0, 60.0)
WITH_T = AIR + '\ntemperature = "T"'


def over_temperature(temps: tuple[float, ...], gain: float = 0.0) -> FloatArray:
    """The wide grid at each temperature; biases and gains change with it."""
    parts = []
    for n, temp in enumerate(temps):
        off = 4.0 * ARCSEC * np.random.default_rng(n).standard_normal(wide().shape)
        d = temp - 20.0
        force = gravity_direction(AIRCRAFT, wide() + off)
        readings = (1.0 + gain * d) * force @ K.T + U0 + np.array([2e-3, -3e-3, 4e-3]) * d
        angles = np.degrees(wide())
        parts.append(np.column_stack([angles, readings, np.full(len(angles), temp)]))
    return np.concatenate(parts)


def test_angles_at_several_temperatures_end_in_c(tmp_path: Path) -> None:
    rows = over_temperature(TEMPS, gain=1e-4)
    folder = write_unit(tmp_path / "U", rows, WITH_T, header=HEADER + ",T")
    delivery = deliver(folder)
    calibration = delivery.calibration
    assert calibration.range_degc == (-20.0, 60.0)
    assert "each pose and 3 temperatures held out in turn" in calibration.selection_reason
    assert calibration.shape.order == 1
    d = np.array([-40.0, -10.0, 15.0, 40.0])[:, None]
    found = calibration.thermal.constants_at(20.0 + d[:, 0])
    bias = U0 + np.array([2e-3, -3e-3, 4e-3]) * d
    truth = np.concatenate([(1.0 + 1e-4 * d) * K.ravel(), bias], axis=1)
    sd = np.sqrt(np.diagonal(calibration.constants_covariance(20.0 + d[:, 0]), axis1=1, axis2=2))
    # 48 values of 24 independent ones: beyond 4.5 once in thousands.
    assert np.abs((found - truth) / sd).max() < 4.5
    assert calibration.recording is not None
    assert calibration.recording.rms_g < 25e-6  # 4 arcsec are 19 micro-g
    assert (calibration.recording.left_out_length_g or 1.0) < 25e-6


def test_an_order_of_tables_is_the_users(tmp_path: Path) -> None:
    rows = over_temperature((0.0, 20.0, 40.0))
    more = '[thermal]\nmodel = "polynomial"\norder = 1\n'
    folder = write_unit(tmp_path / "U", rows, WITH_T, header=HEADER + ",T", more=more)
    calibration = calibrated(folder)
    assert {c.shape.order for c in calibration.candidates} == {1}
    more = more.replace("1", "3")
    folder = write_unit(tmp_path / "V", rows, WITH_T, header=HEADER + ",T", more=more)
    with pytest.raises(
        RefusedError, match="order 3 with poses at 3 temperatures; expected order 2 at"
    ):
        calibrated(folder)


def test_quadratic_terms_of_too_few_poses_are_refused_not_a_fault(tmp_path: Path) -> None:
    """Seven poses are 21 values for 27 unknowns."""
    folder = write_unit(
        tmp_path / "U", GOOD[:22:3][:7], AIR, header=HEADER, more='[fit]\nterms = "quadratic"\n'
    )
    with pytest.raises(
        RefusedError, match=r'do not determine all constants; .* remove terms = "quadratic"'
    ):
        calibrated(folder)


def test_the_roll_of_a_pose_on_its_nose_counts_for_nothing() -> None:
    """At pitch 90 deg any roll is the same pose; at 60 deg an arcsecond of it turns half of one."""
    table = np.radians([[90.0, 0.0], [-90.0, 120.0], [60.0, 10.0], [60.0, -20.0]])
    force = gravity_direction(AIRCRAFT, table + np.radians([[0.0, 77.0], [0, 0], [0, 1], [0, -1]]))
    angles = Angles(AIRCRAFT, ("pitch", "roll"), "deg")
    told = _angle_residuals(angles, table, force)
    # Two of four rows by 3600" cos(60 deg).
    rms = 1800.0 / np.sqrt(2.0)
    assert told.endswith(f"arcsec rms, roll {rms:.3g} arcsec rms")


def test_one_pose_that_all_hangs_on_is_told_by_what_is_left_without_it(tmp_path: Path) -> None:
    """Five poses about x and one that tips it: together well seen, without it x is open."""
    angles = np.radians([[0, 0], [0, 90], [0, 180], [0, 270], [0, 45], [60, 0]])
    folder = write_unit(tmp_path / "U", rows_of(angles), AIR, header=HEADER)
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    told = re.search(
        r"the 6 poses do not determine all constants when some are held out "
        r"\(condition number (\S+)\); "
        "expected at most 1000, with each pose held out in turn; add poses over both angles",
        str(refusal.value),
    )
    assert told is not None
    assert float(told[1]) > 1000.0


def with_outputs(folder: Path, change: FloatArray, *, unit: str = "m/s^2") -> Path:
    """P0's grid with the readings (n, 3) of the outputs multiplied by `change`, (3, 3)."""
    rows = rows_of(table())
    rows[:, 2:] = rows[:, 2:] @ change.T
    recording = AIR.replace('acceleration_unit = "m/s^2"', f'acceleration_unit = "{unit}"')
    return write_unit(folder, rows, recording, header=HEADER)


@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize("output", [0, 1, 2])
def test_a_dead_output_is_named_first(tmp_path: Path, output: int, noise: float) -> None:
    rows = rows_of(table())
    rows[:, 2 + output] = 0.1 + noise * np.random.default_rng(4).standard_normal(len(rows))
    folder = write_unit(tmp_path / "U", rows, AIR, header=HEADER)
    with pytest.raises(RefusedError, match=f"output {'xyz'[output]} does not respond") as refusal:
        calibrated(folder)
    assert "check the wiring and the columns" in str(refusal.value)


def test_a_copied_output_is_named(tmp_path: Path) -> None:
    copy = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    with pytest.raises(RefusedError, match="outputs y and z respond alike"):
        calibrated(with_outputs(tmp_path / "U", copy))


def test_an_output_of_another_scale_is_named(tmp_path: Path) -> None:
    twice = np.diag([1.0, 2.0, 1.0])
    with pytest.raises(RefusedError, match=r"output y is 1\.98 times as sensitive as the other"):
        calibrated(with_outputs(tmp_path / "A", twice))
    counts = calibrated(with_outputs(tmp_path / "B", 1000.0 * twice, unit="count")).recording
    assert counts is not None
    assert any("output y is 1.98 times as sensitive" in f for f in counts.findings)


def test_a_turned_sensor_is_reported(tmp_path: Path) -> None:
    cosine, sine = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned = calibrated(with_outputs(tmp_path / "A", turn)).recording
    straight = calibrated(with_outputs(tmp_path / "B", np.eye(3))).recording
    assert turned is not None
    assert straight is not None
    # Misalignment of up to 5 mrad is in the angle.
    told = next(f for f in turned.findings if f.startswith("the sensor is turned by"))
    assert abs(float(told.split()[5]) - 20.0) < 0.5
    assert not any("turned by" in f or "sensitive" in f for f in straight.findings)
