"""A raw log to its calibration: poses found, candidates judged, and what is wrong told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, U0, K, csv_text, directions, log, write_unit
from scipy.io import savemat

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import fit_folder, refuse_beyond_limits
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.route import calibrate_recording
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import read_unit


def calibrated(folder: Path) -> Calibration:
    fitted = fit_folder(read_unit(folder), folder)
    refuse_beyond_limits(fitted)
    return fitted.calibration


def symmetric_part(matrix: FloatArray) -> FloatArray:
    """K R^T with R such that it is symmetric: the frame "sensor", by polar decomposition."""
    u, s, vt = np.linalg.svd(matrix)
    result: FloatArray = u @ np.diag(s) @ u.T
    assert np.linalg.det(u @ vt) > 0.0
    return result


def found(calibration: Calibration) -> tuple[FloatArray, FloatArray]:
    constants = calibration.thermal.constants_at(20.0)
    return constants[:9].reshape(3, 3), constants[9:]


# ---- the truth comes back ----


def test_a_hand_turned_log_gives_the_truth_in_the_sensors_frame(tmp_path: Path) -> None:
    calibration = calibrated(write_unit(tmp_path / "U", log(directions(20))))
    recording = calibration.recording
    assert recording is not None
    assert len(recording.poses.poses) == 20
    matrix, bias = found(calibration)
    sd = np.sqrt(np.diag(calibration.constants_covariance(20.0)))
    truth = np.concatenate([symmetric_part(K).ravel(), U0])
    errors = np.concatenate([matrix.ravel(), bias]) - truth
    # Twelve values, nine of them independent: beyond 4.5 once in ten thousand.
    assert np.abs(errors / sd).max() < 4.5
    # 150 samples of 0.02 m/s^2: 0.17 mg a pose; own squares of 5 mg/g^2 beside the biases.
    assert sd[:9].max() < 8e-3
    assert sd[9:].max() < 3e-2
    assert recording.rms_g < 0.3e-3
    assert calibration.selection_reason.startswith("linear, with priors scaled by the poses: held")
    assert calibration.terms.quadratic_per_g is None


def test_the_frame_of_the_case_is_that_of_its_faces(tmp_path: Path) -> None:
    """Faces are exact here, so all twelve constants come back."""
    folder = write_unit(tmp_path / "U", log(directions(20)), COLUMNS + '\nframe = "case"')
    calibration = calibrated(folder)
    # A pose is good to 0.17 mg, six faces turn the frame to 0.1 mrad: 3e-3 of 9.8 is three of that.
    assert np.abs(found(calibration)[0] - K).max() < 3e-3
    assert calibration.recording is not None
    assert "frame of the case from 6 poses" in calibration.recording.findings[-1]


def test_counts_in_a_mat_file_with_a_large_bias(tmp_path: Path) -> None:
    """Unsigned counts about 33000, as imu-tk's: the codes are widened to 17 bits."""
    rows = log(directions(20))
    rows[:, 1:] = np.rint(33000.0 + 415.0 * rows[:, 1:])
    recording = "acceleration = [2, 3, 4]\nacceleration_unit = 'count'\ntime = 1"
    folder = write_unit(tmp_path / "U", rows, recording, more='[fit]\nterms = "linear"\n')
    (folder / "log.csv").unlink()
    savemat(folder / "log.mat", {"IMU": rows})
    toml = (folder / "unit.toml").read_text().replace("log.csv", "log.mat")
    (folder / "unit.toml").write_text(toml)
    unit = read_unit(folder)
    assert unit.recording is not None
    unit, _, calibration = calibrate_recording(unit, unit.recording, folder)
    assert (unit.adc.bits, unit.adc.volts_per_code) == (17, 1.0)
    matrix, bias = found(calibration)
    assert np.abs(matrix / 415.0 - symmetric_part(K)).max() < 4e-3
    # 0.17 mg a pose and a scale that 20 poses hold: 1e-3 m/s^2 each, four of them.
    assert np.abs((bias - 33000.0) / 415.0 - U0).max() < 4e-3
    assert calibration.gain_unit == "count/g"


@pytest.mark.parametrize(
    ("change", "recording"),
    [
        (lambda text: text.replace(",", ";").replace(".", ","), COLUMNS + '\ndecimal = ","'),
        (lambda text: text.replace(",", "\t"), COLUMNS),
        (lambda text: text.replace(",", "   "), COLUMNS),
        (lambda text: "made by hand\n\n" + text, COLUMNS + "\nskip_rows = 1"),
        (lambda text: "% one\n" + text, COLUMNS + '\ncomment = "%"'),
        (
            lambda text: text.split("\n", 1)[1],
            'acceleration = [2, 3, 4]\nacceleration_unit = "m/s^2"\ntime = 1',
        ),
        (
            lambda text: text.replace("ax", "a x [m/s2] \N{DEGREE SIGN}"),
            COLUMNS.replace('"ax"', '"a x [m/s2] \N{DEGREE SIGN}"'),
        ),
    ],
    ids=["semicolon-comma", "tab", "spaces", "skip", "comment", "no-header", "odd-name"],
)
def test_other_layouts_read_the_same(
    tmp_path: Path, change: Callable[[str], str], recording: str
) -> None:
    text = csv_text(log(directions(10)), "t,ax,ay,az")
    plain = calibrated(write_unit(tmp_path / "A", text))
    other = calibrated(write_unit(tmp_path / "B", change(text), recording))
    assert np.array_equal(found(plain)[0], found(other)[0])


def test_a_recording_ends_in_the_same_c(tmp_path: Path) -> None:
    """Poses to header with the whole cross-check; the compiled C keeps the residuals of the fit."""
    delivery = deliver(write_unit(tmp_path / "U", log(directions(12))))
    recording = delivery.calibration.recording
    assert recording is not None
    assert delivery.check.total > 10**6
    compiled = next(m for m in delivery.methods if m.method.name == "matrix")
    errors = np.array([r.error_g for r in compiled.residuals])
    # Rounding: a raw code of 2^-16 m/s^2 in three axes, the proven bound, the output.
    rounding = 3 * 2.0**-17 / 9.8 + (delivery.bound.lsb + 1) * 2.0**-24
    assert np.abs(errors - recording.residual_g).max() < rounding
    assert b"raw code = reading / 1.52587891e-05 m/s^2" in delivery.files["triax_calib.h"]


# ---- poses and the reasons of refusals ----


def test_a_short_pose_is_refused_with_its_length(tmp_path: Path) -> None:
    hold = [3.0] * 12
    hold[3] = 1.7
    rows = log(directions(12), hold)
    calibration = calibrated(write_unit(tmp_path / "U", rows, COLUMNS + "\nstill_s = 2"))
    assert calibration.recording is not None
    (refused,) = calibration.recording.poses.refused
    assert refused.number == 4
    # The window that shows motion hides a tenth of a second and more at either end.
    assert refused.reason in {f"1.{d} s at rest, needs 2.0" for d in range(1, 8)}


def test_a_clipped_axis_is_named(tmp_path: Path) -> None:
    rows = log(directions(14))
    rows[:, 3] = np.minimum(rows[:, 3], 9.5)
    calibration = calibrated(write_unit(tmp_path / "U", rows))
    assert calibration.recording is not None
    reasons = {r.number: r.reason for r in calibration.recording.poses.refused}
    told = "axis z is clipped: it stays at 9.5, the largest or smallest reading of the file; "
    assert reasons == dict.fromkeys((1, 7), told + "measure with a wider range")
    assert "output z above 9.5 m/s^2 is clipped, in poses 1, 7: " in "\n".join(calibration.findings)
    words = triaxcal.fit(triaxcal.read_unit(tmp_path / "U")).verdict.words
    assert words.endswith(
        "; z above 9.5 m/s^2 not tested: clipped there; the change with temperature is unknown"
    )


def test_a_pose_that_drifts_has_its_drift_in_its_uncertainty(tmp_path: Path) -> None:
    rows = log(directions(14))
    part = slice(4 * 200, 4 * 200 + 150)  # the fifth pose: 3 s held, 1 s turning before each
    rows[part, 1] += np.linspace(0.0, 0.12, 150)
    calibration = calibrated(write_unit(tmp_path / "U", rows))
    assert calibration.recording is not None
    poses = calibration.recording.poses
    drift, sd = (np.array([getattr(p, name) for p in poses.poses]) for name in ("drift", "sd_mean"))
    assert drift[4, 0] == pytest.approx(0.05, abs=0.01)  # half of what it drifts, less its ends
    # Eight equal parts on a slope: their sd is 0.29 of what it rises, a root of 8 less in the mean.
    assert sd[4, 0] == pytest.approx(0.1 * 0.10, rel=0.3)
    assert np.delete(sd[:, 0], 4).max() < 0.004
    assert poses.weights is not None
    assert poses.weights[4] < 0.2
    assert np.median(poses.weights) > 0.4


def test_gaps_and_missing_rows_are_told(tmp_path: Path) -> None:
    rows = log(directions(14))
    rows[500:, 0] += 7.0
    text = csv_text(rows, "t,ax,ay,az").split("\n")
    text[100] = text[100].split(",")[0] + ",,,"
    text[200] = text[199]
    calibration = calibrated(write_unit(tmp_path / "U", "\n".join(text)))
    assert calibration.recording is not None
    missing, repeated, gap = calibration.recording.findings[:3]
    assert missing == "1 row without all readings left out, the first is line 101"
    told = "1 row with the time of the row before left out (1 of them identical in all columns)"
    assert repeated.startswith(told)
    assert gap.startswith("1 gap in time, the longest 7.02 s before line 502")


def crowded() -> FloatArray:
    some = directions(10)
    return np.concatenate([some, np.tile(some[:1], (24, 1))])


def test_a_crowd_of_alike_poses_is_told_and_counts_once(tmp_path: Path) -> None:
    poses = crowded()
    # Apart from each other: two alike in a row are one pose without turning between.
    order = np.random.default_rng(3).permutation(len(poses))
    calibration = calibrated(write_unit(tmp_path / "U", log(poses[order])))
    assert calibration.recording is not None
    told = [f for f in calibration.recording.findings if "look alike" in f]
    assert len(told) == 1
    assert "together they count as one orientation" in told[0]
    assert "(10 orientations held out in turn)" in calibration.selection_reason


def test_six_faces_twice_are_judged_by_single_poses(tmp_path: Path) -> None:
    """No orientation of six can be held out; each face was taken twice."""
    faces = directions(6)
    calibration = calibrated(write_unit(tmp_path / "U", log(np.concatenate([faces, faces]))))
    assert calibration.selection_reason.startswith("linear, with priors scaled by the poses: held")
    assert (
        "12 single poses, those of equal orientation kept, held out in turn"
        in calibration.selection_reason
    )


def test_six_faces_once_leave_to_the_priors_what_they_do_not_see(tmp_path: Path) -> None:
    calibration = calibrated(write_unit(tmp_path / "U", log(directions(6))))
    assert "no pose is determined by the others, so none is held out" in (
        calibration.selection_reason
    )
    recording = calibration.recording
    assert recording is not None
    assert recording.held_out_g is None
    assert recording.checked
    assert not recording.tested
    shares = {s.name: s for s in recording.shares}
    # A cross term turns a face by an angle that |a| sees only in second order.
    assert shares["Kxy"].data < 0.01
    assert shares["Kxy"].sd == pytest.approx(0.010 * 9.80665, rel=0.03)
    assert shares["Kxx"].data > 0.999
    # The half-sum of two faces holds the bias and the own square together: 5 mg of it.
    assert shares["U0x"].sd == pytest.approx(0.005 * 9.80665, rel=0.1)
    assert shares["Qx.xx"].data < 0.1


@pytest.mark.parametrize("count", [1, 3, 4])
def test_fewer_poses_than_constants_are_bounded_by_the_priors(tmp_path: Path, count: int) -> None:
    """The truth lies within the uncertainty that is stated, which is as large as the priors."""
    some = directions(12)[6 : 6 + count]
    recording = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'
    folder = write_unit(tmp_path / "U", some @ K.T + U0, recording, header="a,b,c")
    calibration = calibrated(folder)
    sd = np.sqrt(np.diag(calibration.constants_covariance(20.0)))
    matrix, bias = found(calibration)
    errors = np.concatenate([matrix.ravel(), bias])
    errors -= np.concatenate([symmetric_part(K).ravel(), U0])
    assert np.abs(errors / sd).max() < 3.5
    assert sd[9:].max() > 0.02 * 9.80665
    # The poses themselves are met.
    assert calibration.recording is not None
    assert calibration.recording.rms_g < 1e-3
    if count < 4:
        assert "bounded by [priors] bias_g = 0.1 g alone" in calibration.findings[0]


# ---- what is refused, each with what to do ----


def left_handed() -> FloatArray:
    """Readings with a gyro that turns the other way: exact rotation about slowly moving axes."""
    t = np.arange(0.0, 60.0, 0.02)
    rate = np.stack([0.8 * np.sin(0.31 * t), 0.7 * np.cos(0.23 * t), 0.6 * np.sin(0.17 * t)], 1)
    a = np.empty((len(t), 3))
    a[0] = [0.0, 0.0, 1.0]
    for k in range(1, len(t)):
        w = rate[k] * 0.02
        angle = np.linalg.norm(w)
        axis = w / angle
        before = a[k - 1]
        a[k] = (
            before * np.cos(angle)
            - np.cross(axis, before) * np.sin(angle)
            + axis * (axis @ before) * (1 - np.cos(angle))
        )
    held = log(directions(12))
    moving = np.column_stack([t + held[-1, 0] + 0.02, 9.8 * a, rate])
    still = np.column_stack([held, 1e-3 * np.random.default_rng(1).standard_normal((len(held), 3))])
    return np.concatenate([still, moving])


WITH_GYRO = COLUMNS + '\ngyro = ["wx", "wy", "wz"]'


def test_a_right_handed_pair_of_triads_passes(tmp_path: Path) -> None:
    rows = left_handed()
    calibrated(write_unit(tmp_path / "U", rows, WITH_GYRO, header="t,ax,ay,az,wx,wy,wz"))


def hot(rows: FloatArray) -> FloatArray:
    return np.column_stack([rows, np.full(len(rows), 25.0)])


BACK = log(directions(12))
BACK[900:, 0] -= 5.0
COARSE = log(directions(12))
COARSE[:, 0] = np.floor(COARSE[:, 0])

REFUSED = {
    "m/s^2-for-g": (
        log(directions(12)),
        {"recording": COLUMNS.replace('"m/s^2"', '"g"')},
        'expected about 1 at rest; m/s^2 taken for g? then acceleration_unit = "m/s^2"',
    ),
    "left-handed": (
        left_handed(),
        {
            "recording": WITH_GYRO.replace('"ax"', '"-ax"'),
            "header": "t,ax,ay,az,wx,wy,wz",
        },
        "the readings agree with the gyro if x, y, z are -x, y, z (correlation 1.00; ",
    ),
    "time-back": (BACK, {}, "line 902: time runs back by 4.98 s; "),
    "coarse-clock": (COARSE, {}, "rows repeat the time of the row before"),
    "one-temperature": (
        hot(log(directions(12))),
        {
            "recording": COLUMNS + '\ntemperature = "T"',
            "header": "t,ax,ay,az,T",
            "more": '[thermal]\nmodel = "polynomial"\norder = 2\n',
        },
        "order 2, but all 12 poses are at one temperature (25 to 25 degC)",
    ),
    "no-such-column": (
        log(directions(12)),
        {"header": "t,ax,ay,a_z"},
        "no column 'az' ([recording] acceleration) (did you mean \"a_z\"?)",
    ),
    "another-delimiter": (
        log(directions(12)),
        {"recording": COLUMNS + '\ndelimiter = "semicolon"'},
        "a line is one cell when semicolon separates the cells; if another sign does, name it",
    ),
    "doubled-column": (
        log(directions(12)),
        {"header": "t,ax,ax,az"},
        "2 columns 'ax' ([recording] acceleration); expected one of that name; give its number",
    ),
    "all-moving": (
        log(directions(12), 0.4),
        {},
        "no pose found: it moves all the time; even at its quietest the mean reading changes by ",
    ),
    "adc-too-narrow": (
        log(directions(12)),
        {"more": "[adc]\nbits = 16\n"},
        "-32768 to 32767 codes of [adc]; set [adc] bits = 24",
    ),
    "beyond-limit": (
        log(directions(12)),
        {"more": "[limits]\nat_t0_g = 1e-6\n"},
        "expected at most 0.001 mg (limits.at_t0_g); check that pose with `triaxcal poses`",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_named_with_what_to_do(tmp_path: Path, name: str) -> None:
    rows, options, told = REFUSED[name]
    folder = write_unit(tmp_path / "U", rows, **options)
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    assert told in str(refusal.value)


def test_quadratic_terms_that_cannot_be_scored_do_not_end_in_a_fault(tmp_path: Path) -> None:
    random = np.random.default_rng(3).standard_normal((12, 3))
    poses = random / np.linalg.norm(random, axis=1, keepdims=True)
    folder = write_unit(tmp_path / "U", log(poses), more='[fit]\nterms = "quadratic"\n')
    told = calibrated(folder).selection_reason
    assert told.startswith("all terms, with priors scaled by the poses: held")
    assert '[firmware] or [fit] terms = "quadratic"' in told


def test_a_stray_quotation_mark_is_refused_with_its_line(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", log(directions(12)))
    path = folder / "log.csv"
    lines = path.read_text().splitlines()
    lines[40] = '"' + lines[40]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(RefusedError, match="line 41"):
        calibrated(folder)
