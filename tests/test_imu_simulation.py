"""The IMU simulator against physics; nothing here knows its formulas or the filter's."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynamic_cases import perfect
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import INCREMENT, INSTANT, ImuSamples
from triaxcal.model.types import FloatArray
from triaxcal.simulation import imu, imu_noise
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import AVIATION, EFFECTS, GRADES, MEMS, draw_truth
from triaxcal.simulation.imu_kinematics import EARTH_RATE_RAD_PER_S, BodyMotion, body_motion
from triaxcal.simulation.imu_motion import (
    PRECISE_TABLE,
    ImuMotion,
    Mounting,
    Move,
    RoughTable,
    three_axes,
)
from triaxcal.simulation.imu_sensors import Moments, accel_readings, gyro_readings
from triaxcal.simulation.imu_temperature import WARMING
from triaxcal.simulation.imu_truth import ARCSEC, DEG_PER_H, ImuNoise, ImuTruth, SecondTriad

ROOM = Path(__file__).parent.parent / "toolchain" / "triaxcal" / "simulation"
RIGID = np.zeros((3, 3))
CENTRES = ((30.0, -40.0, 50.0), (-20.0, 35.0, 60.0), (45.0, 10.0, -25.0))
SHORT = three_axes(1.0, still_s=5.0, centre_mm=CENTRES, temperature=WARMING)
ELASTIC = ARCSEC * np.array([[0, 900.0, -700], [500, 0, 800], [-600, 400, 0]])
"""Soft as rubber, so that what is wrong shows."""


def moving_times(count: int, seed: int) -> FloatArray:
    """Times in stand-stills, moves, remountings and at their borders."""
    rng = np.random.default_rng(seed)
    borders = np.concatenate([SHORT.table_angle.breaks_s[1:], SHORT.mounting_angle.breaks_s[1:]])
    times = np.concatenate([rng.uniform(0.0, SHORT.duration_s, count), borders])
    result: FloatArray = np.sort(times)
    return result


def within_pieces(times: FloatArray, margin_s: float) -> FloatArray:
    """Those not so near to a border that a stencil would reach over it."""
    pieces = (SHORT.table_angle, SHORT.mounting_angle, SHORT.lift)
    borders = np.concatenate([f.breaks_s[1:] for f in pieces])
    result: FloatArray = times[np.abs(times[:, None] - borders).min(axis=1) > margin_s]
    return result


def attitude(body: BodyMotion) -> FloatArray:
    """From instrument axes to east, north, up, shape (n, 3, 3), by the plumb line and the Earth."""
    east = np.cross(body.earth.T, body.up.T)
    east /= np.linalg.norm(east, axis=1)[:, None]
    return np.stack([east, np.cross(body.up.T, east), body.up.T], axis=1)


def derivative(values: FloatArray, step: float, order: int) -> FloatArray:
    """From five equidistant values along the first axis, to the fourth power of the step."""
    weights = {1: (1.0, -8.0, 0.0, 8.0, -1.0), 2: (-1.0, 16.0, -30.0, 16.0, -1.0)}[order]
    result: FloatArray = np.tensordot(weights, values, 1) / (12.0 * step**order)
    return result


# ---- the motion ----


@pytest.mark.parametrize("elasticity", [RIGID, ELASTIC], ids=["rigid", "elastic"])
def test_vectors_fixed_to_the_earth_turn_as_the_rate_says(elasticity: FloatArray) -> None:
    """The plumb line, the Earth's axis and the rate itself, differentiated numerically.

    The stencil errs by h^4 / 30 times the fifth derivative: (11.9 * 1.05 rad/s)^5 times the ripple
    of 9e-4 / 3 rad is 92 /s^5, times 3e-14: 3e-12; rounding 1e-16 / h = 1e-13. The polynomials have
    four derivatives within a piece and two across a border: there h^2 times 30 rad/s^4 is left.
    """
    h = 1e-3
    times = within_pieces(moving_times(400, 1), 3 * h)
    bodies = [body_motion(SHORT, elasticity, times + k * h) for k in range(-2, 3)]
    now = bodies[2]
    relative = now.rate - now.earth
    for name in ("up", "earth"):
        vector = getattr(now, name)
        by_rate = -np.cross(relative, vector, axis=0)
        numeric = derivative(np.stack([getattr(b, name) for b in bodies]), h, 1)
        size = 1.0 if name == "up" else EARTH_RATE_RAD_PER_S
        assert np.abs(numeric - by_rate).max() < 2e-10 * size, name
    numeric = derivative(np.stack([b.rate for b in bodies]), h, 1)
    assert np.abs(numeric - now.acceleration).max() < 2e-8


def test_whole_turns_come_back() -> None:
    """On a table that is level or not, wobbling or not: the same angle is the same attitude."""
    table = RoughTable(ripple_deg=0.0, wobble_arcsec=3600.0, elevation_deg=3.0)
    moves = (Move(360.0, 50.0, 5.0), Move(-1080.0, 60.0, 5.0), Move(720.0, 7.0, 5.0))
    motion = ImuMotion((Mounting(moves, 5.0, (0.5, -0.7, 0.9)),), table)
    ends = [4.0]
    for move in moves:
        ends.append(ends[-1] + move.turning_s(table.ramp_s) + move.stop_s)
    body = body_motion(motion, ELASTIC, np.array(ends))
    # 2 pi times 3 turns is rounded to 4e-15.
    assert np.abs(body.up - body.up[:, :1]).max() < 1e-14
    assert np.abs(body.rate - body.rate[:, :1]).max() < 1e-14 * EARTH_RATE_RAD_PER_S * 10
    # And a quarter of a turn is not.
    later = body_motion(motion, ELASTIC, np.array([5.0 + 1.0 + 90.0 / 50.0]))
    assert np.abs(later.up - body.up[:, :1]).max() > 0.5


def test_axes_of_the_table_are_where_it_says() -> None:
    """Mounted by axis 1 at azimuth 90 deg: x east, z up, y north; the Earth turns about north."""
    motion = ImuMotion((Mounting(()),), RoughTable(90.0, 0.0, 0.0, 0.0), latitude_deg=60.0)
    body = body_motion(motion, RIGID, np.array([1.0]))
    assert np.allclose(body.up[:, 0], [0, 0, 1], atol=1e-15)
    expected = EARTH_RATE_RAD_PER_S * np.array([0.0, 0.5, math.sqrt(0.75)])
    assert np.allclose(body.earth[:, 0], expected, atol=1e-19)
    raised = replace(motion, table=RoughTable(90.0, 1.0, 0.0, 0.0))
    # The nose up by 1 deg: gravity's reaction has a part along it.
    up = body_motion(raised, RIGID, np.array([1.0])).up[:, 0]
    assert np.allclose(up, [math.sin(math.radians(1)), 0, math.cos(math.radians(1))], atol=1e-15)


@pytest.mark.parametrize("k", [0, 1, 2])
def test_each_mounting_turns_about_its_axis(k: int) -> None:
    motion = three_axes(1.0, still_s=5.0, placement_deg=((0.0, 0.0, 0.0),) * 3)
    time = np.array([motion.start_s[k] + 7.5])
    body = body_motion(motion, RIGID, time)
    rate_deg_per_s = np.degrees(body.rate[:, 0])
    # 30 deg/s by the programme; the ripple changes it by 0.7 %, the axis leans 2 arcmin.
    assert rate_deg_per_s[k] == pytest.approx(30.0, rel=8e-3)
    assert np.abs(np.delete(rate_deg_per_s, k)).max() < 0.05
    start, matrix = motion.turntable().mountings[k]
    assert start == motion.start_s[k]
    assert (matrix @ [1.0, 0.0, 0.0])[k] == 1.0


def test_table_angle_with_the_mounting_gives_the_attitude() -> None:
    """What a reader of the table's papers computes is the attitude, when the table is precise."""
    placement = ((0.0, 0.0, 0.0),) * 3
    motion = three_axes(1.0, still_s=5.0, table=PRECISE_TABLE, placement_deg=placement)
    samples = simulate_imu(ImuTruth(), motion, 20.0, 1).all()
    assert samples.table_angle_rad is not None
    papers = motion.turntable()
    az, el = papers.azimuth_rad, papers.elevation_rad
    axis = np.array([math.sin(az) * math.cos(el), math.cos(az) * math.cos(el), math.sin(el)])
    third = np.array([0.0, 0.0, 1.0]) - math.sin(el) * axis
    third /= np.linalg.norm(third)
    table = np.stack([axis, np.cross(third, axis), third])
    body = body_motion(motion, RIGID, samples.time_s)
    true = np.swapaxes(attitude(body), 1, 2)  # to instrument axes
    for n in range(0, len(samples), 7):
        time = samples.time_s[n]
        k = max(j for j, start in enumerate(motion.start_s) if start <= time)
        if k + 1 < 3 and time > motion.start_s[k + 1] - motion.remount_s:
            continue
        c, s = math.cos(samples.table_angle_rad[n]), math.sin(samples.table_angle_rad[n])
        plate = np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) @ table
        # The east direction is a quotient by the Earth's rate, in double precision: 1e-12.
        assert np.abs(papers.mountings[k][1] @ plate - true[n]).max() < 1e-11


# ---- the force ----


def test_at_rest_gravity_and_the_earth_are_all_there_is() -> None:
    motion = three_axes(1.0, still_s=5.0, centre_mm=CENTRES)
    body = Moments.of(ImuTruth(), motion, np.linspace(0.0, 4.9, 7))
    force, rate = accel_readings(ImuTruth(), body), gyro_readings(ImuTruth(), body)
    # The arm of 8 cm turns with the Earth: 5e-9 * 0.08 m/s^2.
    assert np.abs(np.linalg.norm(force, axis=0) - 9.8107).max() < 1e-9
    assert np.linalg.norm(rate, axis=0) == pytest.approx(EARTH_RATE_RAD_PER_S, rel=1e-13)
    north_up = math.sin(math.radians(50.0))
    along = (rate * force).sum(axis=0) / 9.8107
    assert along == pytest.approx(EARTH_RATE_RAD_PER_S * north_up, rel=1e-9)


def test_force_is_the_second_derivative_of_the_path_in_inertial_space() -> None:
    """Path of a proof mass by attitude alone, with the Earth turning, differentiated twice.

    h = 2 ms: the stencil errs by h^4 / 90 times the sixth derivative, 0.1 m (12.5 /s)^6 times the
    ripple of 3e-4: 115 m/s^6, so 2e-11; turning at 1.05 /s gives 0.1 m/s^6 and rounding of a
    path of 0.1 m 30 * 1e-17 / h^2 = 1e-10. Attitudes from the plumb line and the Earth's axis
    have 1e-15 of rounding divided by nothing: 1e-15 * 0.1 * 30 / (12 h^2) = 6e-11.
    """
    h, mass_mm = 2e-3, (25.0, 60.0, -35.0)
    truth = ImuTruth(accel_position_mm=((0.0, 0.0, 0.0), mass_mm, mass_mm))
    times = within_pieces(moving_times(300, 2), 3 * h)
    latitude = math.radians(SHORT.latitude_deg)
    pole = np.array([0.0, math.cos(latitude), math.sin(latitude)])

    def path(at: FloatArray) -> FloatArray:
        body = body_motion(SHORT, RIGID, at)
        centre = sum(
            1e-3 * np.array(m.centre_mm) * p.jet(at)[0][:, None]
            for m, p in zip(SHORT.mountings, SHORT.present, strict=True)
        )
        place = 1e-3 * np.array(mass_mm) - centre
        on_earth = np.einsum("nij,nj->ni", attitude(body), place)
        on_earth[:, 2] += SHORT.lift.jet(at)[0]
        turn = EARTH_RATE_RAD_PER_S * (at - times)  # inertial axes are the Earth's at `times`
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        along = (on_earth @ pole)[:, None] * pole
        return c * on_earth + s * np.cross(pole, on_earth) + (1.0 - c) * along

    acceleration = derivative(np.stack([path(times + k * h) for k in range(-2, 3)]), h, 2)
    acceleration[:, 2] += SHORT.gravity_m_per_s2
    body = body_motion(SHORT, RIGID, times)
    expected = np.einsum("nji,nj->ni", attitude(body), acceleration).T
    force = accel_readings(truth, Moments(SHORT, times, body))
    assert np.abs(force[1:] - expected[1:]).max() < 3e-9
    assert np.abs(force[0] - expected[0]).max() > 1e-3  # the first proof mass is elsewhere


def test_centripetal_acceleration_is_rate_squared_times_the_arm() -> None:
    """60 deg/s, 0.1 m from the axis: 0.1097 m/s^2 towards it; along the axis nothing."""
    moves = (Move(3600.0, 60.0),)
    table = RoughTable(elevation_deg=0.0, wobble_arcsec=0.0, ripple_deg=0.0)
    at = np.linspace(15.0, 25.0, 11)
    near = ImuMotion((Mounting(moves, 10.0),), table)
    far = ImuMotion((Mounting(moves, 10.0, centre_mm=(70.0, 0.0, -100.0)),), table)
    truth = ImuTruth()
    difference = accel_readings(truth, Moments.of(truth, far, at)) - accel_readings(
        truth, Moments.of(truth, near, at)
    )
    rate = math.radians(60.0)
    # The Earth turns too: 2 * 1.05 * 7.3e-5 * 0.12 = 1.9e-5 m/s^2 at most.
    assert np.abs(difference[2] + 0.1 * rate**2).max() < 2e-5
    assert np.abs(difference[:2]).max() < 2e-5


# ---- sampling ----


@pytest.mark.parametrize("grade", GRADES)
def test_increments_add_up_and_converge(grade: str) -> None:
    """Increments at 25 Hz are sums of those at 50 Hz.

    Quadrature with three nodes errs by (h w)^6 / 2 016 000 per interval: 11.9 * 1.05 rad/s at 40 ms
    is 8e-9 of the rippling rate of 4e-3 rad/s and of the force's changes; within a piece. No
    border is inside an interval: all are at multiples of 40 ms, as is the delay.
    """
    truth = perfect(draw_truth(GRADES[grade], 3, tuple(EFFECTS)))
    assert truth.second is not None
    truth = replace(truth, accel_delay_ms=40.0, second=replace(truth.second, delay_ms=-40.0))
    truth = replace(truth, rate_convention=INCREMENT, force_convention=INCREMENT)
    slow, fast = (simulate_imu(truth, SHORT, rate, 0).all() for rate in (25.0, 50.0))
    for name, size in (("rate", 1.0), ("force", 9.8), ("force2", 9.8)):
        sums = getattr(fast, name).reshape(len(slow), 2, 3).sum(axis=1)
        assert np.abs(sums - getattr(slow, name)).max() < 2e-9 * size, name
    assert np.array_equal(fast.time_s[1::2], slow.time_s)


def test_increments_are_the_integral_of_instants() -> None:
    """By Simpson's rule over the instants at twice the rate, which is another quadrature.

    It errs by (h w)^4 / 2880: of the ripple's 4e-3 rad/s * 10 ms with w = 11.9 * 1.05 rad/s, and of
    9.8 m/s^2 * 10 ms with w = 1.05 rad/s. Without a delay no border is inside an interval.
    """
    truth = replace(perfect(draw_truth(AVIATION, 4, tuple(EFFECTS))), accel_delay_ms=0.0)
    instants = replace(truth, rate_convention=INSTANT, force_convention=INSTANT)
    whole = simulate_imu(truth, SHORT, 100.0, 0).all()
    points = simulate_imu(instants, SHORT, 200.0, 0).all()
    for name, size in (("rate", 1.0), ("force", 9.8)):
        values = getattr(points, name)
        simpson = (values[1:-2:2] + 4.0 * values[2:-1:2] + values[3::2]) / 6.0 / 100.0
        assert np.abs(simpson - getattr(whole, name)[1:]).max() < 1e-9 * size, name


def test_a_half_sample_matters_and_is_right() -> None:
    """The mean over an interval is the value in its middle, not at its end."""
    truth = ImuTruth()
    h = 1.0 / 200.0
    whole = simulate_imu(truth, SHORT, 200.0, 0).all()
    for shift, close in ((h / 2, True), (0.0, False)):
        times = whole.time_s - shift
        instants = accel_readings(truth, Moments.of(truth, SHORT, times)).T
        # Second derivative of the force at 1.05 rad/s and of the lever arm's ripple:
        # h^2 / 24 * 30 m/s^4. A half-sample's error is 1.05 * 9.81 * h / 2 = 25.7 mm/s^2.
        largest = float(np.abs(whole.force / h - instants).max())
        assert (largest < 5e-5) is close
        assert close or largest == pytest.approx(0.0257, rel=0.02)


def test_a_delay_is_a_shift_of_the_accelerometers() -> None:
    """10 ms at 200 Hz are two samples; each triad has its own, and the gyros do not wait."""
    second = SecondTriad(delay_ms=-5.0)
    truth = replace(perfect(draw_truth(MEMS, 5)), second=second, accel_delay_ms=10.0)
    late = simulate_imu(truth, SHORT, 200.0, 0).all()
    truth = replace(truth, second=SecondTriad(), accel_delay_ms=0.0)
    prompt = simulate_imu(truth, SHORT, 200.0, 0).all()
    assert late.force2 is not None
    assert prompt.force2 is not None
    # Times that differ by rounding of 0.005 n - 0.01, and a jerk of 10 m/s^3.
    assert np.abs(late.force[2:] - prompt.force[:-2]).max() < 1e-11
    assert np.abs(late.force2[:-1] - prompt.force2[1:]).max() < 1e-11
    assert np.array_equal(late.rate, prompt.rate)


def test_the_table_runs_and_rests_as_planned() -> None:
    assert SHORT.duration_s == pytest.approx(3 * 60 + 2 * 20, abs=3 * 30)
    forty = three_axes()
    assert all(
        2300.0 < end - start < 2440.0
        for start, end in zip(forty.start_s, [*forty.start_s[1:], forty.duration_s], strict=True)
    )
    rates = {move.rate_deg_per_s for m in forty.mountings for move in m.moves}
    assert (min(rates), max(rates)) == (5.0, 60.0)


def test_too_short_a_motion_is_refused() -> None:
    with pytest.raises(RefusedError) as refused:
        three_axes(0.2, still_s=10.0)
    assert str(refused.value) == (
        "motion of a simulated IMU: 0.2 min an axis, 10 s of it at rest; expected time for at "
        "least three moves"
    )
    with pytest.raises(ValueError, match="does not reach the rate"):
        ImuMotion((Mounting((Move(10.0, 60.0),)),))
    with pytest.raises(ValueError, match="there are three axes"):
        ImuMotion(())


# ---- the effects, each against the first-order formula of the paper ----


def test_model_of_the_triads() -> None:
    truth = draw_truth(MEMS, 6)
    at = Moments.of(truth, SHORT, moving_times(50, 3))
    ideal = Moments(SHORT, at.time_s, at.body)
    w, f = gyro_readings(ImuTruth(), ideal), accel_readings(ImuTruth(), ideal)
    for axis in range(3):
        nu = DEG_PER_H * truth.gyro_bias_deg_per_h[axis]
        row = dict(zip((12, 13, 21, 23, 31, 32), truth.gyro_misalignment_arcsec, strict=True))
        expected = w[axis] * (1 + 1e-6 * truth.gyro_scale_ppm[axis]) + nu
        for name, angle in row.items():
            if name // 10 == axis + 1:
                expected = expected + ARCSEC * angle * w[name % 10 - 1]
        assert gyro_readings(truth, at)[axis] == pytest.approx(expected, rel=1e-14, abs=1e-16)
        lower = dict(zip((21, 31, 32), truth.accel_misalignment_arcsec, strict=True))
        expected = f[axis] * (1 + 1e-6 * truth.accel_scale_ppm[axis])
        expected = expected + 1e-3 * truth.accel_bias_mm_per_s2[axis]
        for name, angle in lower.items():
            if name // 10 == axis + 1:
                expected = expected + ARCSEC * angle * f[name % 10 - 1]
        assert accel_readings(truth, at)[axis] == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_gyro_elasticity_is_equation_20() -> None:
    """The printed matrices, rebuilt as images of each other under x -> y -> z -> x."""
    k12, k13, k22, k23, k32, k33 = kappa = (1.1, -2.3, 3.7, 0.4, -5.2, 2.9)
    truth = ImuTruth(gyro_elasticity_arcsec_per_g=kappa)
    at = Moments.of(truth, SHORT, moving_times(80, 4))
    w = at.body.rate
    f = at.force(np.zeros(3)) / SHORT.gravity_m_per_s2
    zero = 0.0
    m1 = np.array([[zero, k13, -k12], [-k32, zero, k33], [k23, -k22, zero]])
    m2 = np.array([[zero, k23, -k22], [-k12, zero, k13], [k33, -k32, zero]])
    m3 = np.array([[zero, k33, -k32], [-k22, zero, k23], [k13, -k12, zero]])
    printed = ARCSEC * sum(f[i] * (m @ w) for i, m in enumerate((m1, m2, m3)))
    # Second order: half the angle of 9" squared times 1.05 rad/s.
    assert np.abs(gyro_readings(truth, at) - w - printed).max() < 2e-9
    assert np.abs(printed).max() > 5e-6


def test_mount_elasticity_is_equation_19() -> None:
    """The unit on soft mounts is turned by D f/g, right-handed, against the unit on stiff ones."""
    truth = ImuTruth(mount_elasticity_arcsec_per_g=(12.0, -7.0, 5.0, 9.0, -11.0, 4.0))
    at = moving_times(80, 5)
    soft, stiff = (body_motion(SHORT, d, at) for d in (truth.mount_elasticity_rad(), RIGID))
    turn = truth.mount_elasticity_rad() @ stiff.up
    expected = stiff.up - np.cross(turn, stiff.up, axis=0)
    # Second order: the square of 20".
    assert np.abs(soft.up - expected).max() < 2e-8
    assert np.abs(soft.up - stiff.up).max() > 5e-5


def test_drift_of_gyros_by_force_is_equation_13() -> None:
    rows = ((1.0, 2.0, 3.0), (-4.0, 5.0, -6.0), (7.0, -8.0, 9.0))
    truth = ImuTruth(gyro_g_deg_per_h_per_g=rows)
    at = Moments.of(truth, SHORT, moving_times(80, 6))
    expected = DEG_PER_H * np.array(rows) @ at.force(np.zeros(3)) / SHORT.gravity_m_per_s2
    # Differences of 1 rad/s, rounded.
    assert np.abs(gyro_readings(truth, at) - at.body.rate - expected).max() < 1e-15


def test_temperature_coefficients_are_equations_23_and_24() -> None:
    truth = ImuTruth(
        accel_bias_mm_per_s2_per_k=(1.0, -2.0, 3.0),
        accel_scale_ppm_per_k=(10.0, 20.0, -30.0),
        gyro_bias_deg_per_h_per_k=(4.0, -5.0, 6.0),
        gyro_scale_ppm_per_k=(7.0, -8.0, 9.0),
        reference_degc=22.0,
    )
    at = Moments.of(truth, SHORT, moving_times(80, 7))
    warm = WARMING.at(at.time_s) - 22.0
    w, f = gyro_readings(ImuTruth(), at), accel_readings(ImuTruth(), at)
    for axis in range(3):
        drift = DEG_PER_H * truth.gyro_bias_deg_per_h_per_k[axis]
        scale = 1e-6 * truth.gyro_scale_ppm_per_k[axis]
        expected = w[axis] + warm * (drift + scale * w[axis])
        assert gyro_readings(truth, at)[axis] == pytest.approx(expected, rel=1e-14, abs=1e-15)
        bias = 1e-3 * truth.accel_bias_mm_per_s2_per_k[axis]
        scale = 1e-6 * truth.accel_scale_ppm_per_k[axis]
        expected = f[axis] + warm * (bias + scale * f[axis])
        assert accel_readings(truth, at)[axis] == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert warm.min() < -1.0
    assert warm.max() > 1.0


def test_second_triad_has_a_full_matrix_and_places_of_its_own() -> None:
    second = SecondTriad((1.0, 2.0, 3.0), (10.0, 20.0, 30.0), (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    samples = simulate_imu(ImuTruth(second=second), SHORT, 20.0, 0).all()
    f = simulate_imu(ImuTruth(), SHORT, 20.0, 0).all().force
    matrix = np.array([[0, 1, 2], [3, 0, 4], [5, 6, 0]]) * ARCSEC + np.diag([1e-5, 2e-5, 3e-5])
    expected = f @ (np.eye(3) + matrix).T + np.array([1e-3, 2e-3, 3e-3]) / 20.0
    assert samples.force2 == pytest.approx(expected, rel=1e-13, abs=1e-15)
    assert simulate_imu(ImuTruth(), SHORT, 20.0, 0).all().force2 is None


# ---- noise and counts ----


def still(seconds: float) -> ImuMotion:
    return ImuMotion((Mounting((), seconds),))


def test_noise_is_what_the_data_sheet_says() -> None:
    """Mean squares of 20 000 x 3 readings scatter by sqrt(2 / 60 000): 0.58 %; five of it."""
    noise = ImuNoise(gyro_arw_deg_per_sqrt_h=0.3, accel_vrw_ug_per_sqrt_hz=50.0, temp_sd_degc=0.1)
    for convention in (INCREMENT, INSTANT):
        truth = ImuTruth(noise=noise, rate_convention=convention, force_convention=convention)
        samples = simulate_imu(truth, still(200.0), 100.0, 7).all()
        exact = simulate_imu(perfect(truth), still(200.0), 100.0, 7).all()
        step = 0.01 if convention == INCREMENT else 1.0
        # The angle wanders by 0.3 deg in an hour: 0.3 / 60 deg in a second; a reading is 10 ms.
        expected = step * math.radians(0.3 / 60.0) / math.sqrt(0.01)
        assert _rms(samples.rate - exact.rate) == pytest.approx(expected, rel=0.03)
        expected = step * 50e-6 * 9.80665 / math.sqrt(0.01)
        assert _rms(samples.force - exact.force) == pytest.approx(expected, rel=0.03)
        assert samples.temp_degc is not None
        # One column: 1 %, five of it.
        assert _rms(samples.temp_degc - 20.0) == pytest.approx(0.1, rel=0.05)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_biases_walk_as_the_data_sheet_says() -> None:
    """After 50 s the walk is K sqrt(50 s); over 200 seeds and 3 axes the rms scatters by 3 %."""
    noise = ImuNoise(gyro_walk_deg_per_h_per_sqrt_h=2.0, accel_walk_ug_per_sqrt_h=30.0)
    truth = ImuTruth(noise=noise, rate_convention=INSTANT, force_convention=INSTANT)
    exact = simulate_imu(perfect(truth), still(50.0), 10.0, 0).all()
    ends = []
    for seed in range(200):
        samples = simulate_imu(truth, still(50.0), 10.0, seed).all()
        ends.append((samples.rate[-1] - exact.rate[-1], samples.force[-1] - exact.force[-1]))
    gyro, accel = (np.array(values) for values in zip(*ends, strict=True))
    hours = 50.0 / 3600.0
    assert _rms(gyro) == pytest.approx(2.0 * DEG_PER_H * math.sqrt(hours), rel=0.15)
    assert _rms(accel) == pytest.approx(30e-6 * 9.80665 * math.sqrt(hours), rel=0.15)


def test_counts_lose_nothing_of_the_sum() -> None:
    truth = ImuTruth(noise=ImuNoise(gyro_lsb=1.0, accel_lsb=0.5))
    samples = simulate_imu(truth, SHORT, 100.0, 1).all()
    exact = simulate_imu(perfect(truth), SHORT, 100.0, 1).all()
    for name, lsb in (("rate", ARCSEC), ("force", 0.5e-3)):
        counts = getattr(samples, name) / lsb
        assert np.abs(counts - np.rint(counts)).max() < 1e-9
        sums = np.cumsum(getattr(samples, name) - getattr(exact, name), axis=0)
        # Half a count, and the rounding of a sum of 30 000.
        assert np.abs(sums).max() < 0.5 * lsb * (1 + 1e-6)


def test_counts_of_instants_round_each_reading() -> None:
    noise = ImuNoise(gyro_lsb=36.0, accel_lsb=100.0)
    truth = ImuTruth(noise=noise, rate_convention=INSTANT, force_convention=INSTANT)
    samples = simulate_imu(truth, SHORT, 50.0, 1).all()
    exact = simulate_imu(perfect(truth), SHORT, 50.0, 1).all()
    for name, lsb in (("rate", 36.0 * DEG_PER_H), ("force", 100e-6 * 9.80665)):
        error = getattr(samples, name) - getattr(exact, name)
        assert 0.49 * lsb < np.abs(error).max() < 0.5 * lsb * (1 + 1e-9)


def test_a_recording_does_not_depend_on_its_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = draw_truth(AVIATION, 8, tuple(EFFECTS))
    truth = replace(truth, noise=replace(truth.noise, gyro_walk_deg_per_h_per_sqrt_h=0.1))
    motion = three_axes(1.0, still_s=5.0, table=PRECISE_TABLE, centre_mm=CENTRES)
    recording = simulate_imu(truth, motion, 50.0, 9)
    first, again = recording.all(), recording.all()
    monkeypatch.setattr(imu, "PIECE", 777)
    cut = recording.all()
    for name in ImuSamples.__dataclass_fields__:
        if getattr(first, name) is None:  # what only a repaired log has
            assert getattr(again, name) is None
            assert getattr(cut, name) is None
            continue
        assert np.array_equal(getattr(first, name), getattr(again, name)), name
        # A sum is continued from its remainder in another order: one count at a border of rounding.
        assert np.abs(getattr(first, name) - getattr(cut, name)).max() < 1.01e-5, name
    assert np.count_nonzero(first.rate != cut.rate) < 20
    other = simulate_imu(truth, motion, 50.0, 10).all()
    assert not np.array_equal(first.rate, other.rate)


def test_units_drawn_differ_only_in_what_is_switched_on() -> None:
    plain, more = draw_truth(MEMS, 11), draw_truth(MEMS, 11, ("delay", "second-triad"))
    assert replace(more, accel_delay_ms=0.0, second=None) == plain
    assert more.accel_delay_ms != 0.0
    assert draw_truth(MEMS, 12) != plain
    assert draw_truth(AVIATION, 11).accel_position_mm == ((0.0, 0.0, 0.0),) * 3
    assert draw_truth(AVIATION, 11, ("accel-positions",)).accel_position_mm[0] == (0.0, 0.0, 0.0)


def test_noise_and_constants_have_generators_of_their_own() -> None:
    sources = {imu_noise.GYRO, imu_noise.ACCEL, imu_noise.SECOND, imu_noise.TEMPERATURE}
    sources |= {imu_noise.TABLE, *(source + 10 for source in list(sources))}
    assert len(sources) == 9
    assert min(sources) >= len(ImuTruth.__dataclass_fields__)


def test_only_the_container_is_shared_with_the_filter() -> None:
    """A simulator that used the filter's equations would confirm their errors."""
    for path in ROOM.glob("imu*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert "dynamic" not in name or name == "triaxcal.dynamic.recording", path.name
