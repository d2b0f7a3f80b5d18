"""Poses over temperature: thermal orders chosen on what was left out, the same C at the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, U0, K, directions, log, write_unit
from scipy.optimize import least_squares
from test_recordings import calibrated, symmetric_part

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.judgement import not_tested
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.recorded.temperatures import temperature_groups
from triaxcal.model.types import FloatArray

WITH_T = COLUMNS + '\ntemperature = "T"'
TEMPS = (-20.0, 0.0, 20.0, 40.0, 60.0)
SLOPE = np.array([2e-3, -3e-3, 4e-3])
"""Of the biases, m/s^2 per degC; and a square of them besides."""
SQUARE = np.array([2e-5, 1e-5, -3e-5])


def cycle(temps: tuple[float, ...] = TEMPS, poses: int = 14, gain: float = 0.0) -> FloatArray:
    """Fourteen poses at each temperature; gains change by `gain` a degC."""
    parts, start = [], 0.0
    for n, temp in enumerate(temps):
        rows = log(directions(poses, seed=n), seed=n)
        d = temp - 20.0
        rows[:, 1:] = (rows[:, 1:] - U0) * (1.0 + gain * d) + U0 + SLOPE * d + SQUARE * d**2
        rows[:, 0] += start
        start = rows[-1, 0] + 600.0
        parts.append(np.column_stack([rows, np.full(len(rows), temp)]))
    return np.concatenate(parts)


def unit_with(folder: Path, rows: FloatArray, more: str = "") -> Path:
    return write_unit(folder, rows, WITH_T, header="t,ax,ay,az,T", more=more)


def test_a_bias_between_the_temperatures_is_missed_at_temperatures_held_out(
    tmp_path: Path,
) -> None:
    """A jump of 10 mg at 40 degC: residuals to 5.3 mg, 2.3 mg rms with orientations held out."""
    rows = cycle()
    jump = np.where(rows[:, 4] == 40.0, 0.1, 0.0)
    rows[:, 1:4] += jump[:, None]
    more = (
        '[thermal]\nmodel = "polynomial"\norder = 3\n'
        "[limits]\nat_t0_g = 0.007\nover_range_g = 0.007\n"
    )
    with pytest.raises(RefusedError, match="temperature held out in turn; the largest is"):
        deliver(unit_with(tmp_path / "U", rows, more))


def test_biases_of_second_order_are_found_and_end_in_c(tmp_path: Path) -> None:
    delivery = deliver(unit_with(tmp_path / "U", cycle()))
    calibration = delivery.calibration
    # A third order does no harm that 70 poses could show; a first is seven times worse.
    assert calibration.shape.order in (2, 3)
    scores = {c.label: c.held_out_g or 1.0 for c in calibration.candidates}
    assert min(scores.values()) < 0.25e-3
    assert scores["linear, with priors; order 1"] > 1e-3
    assert (calibration.range_degc, delivery.unit.t0_degc) == ((-20.0, 60.0), 20.0)
    temps = np.array([-15.0, 10.0, 35.0, 55.0])
    d = (temps - 20.0)[:, None]
    found = calibration.thermal.constants_at(temps)
    sd = np.sqrt(np.diagonal(calibration.constants_covariance(temps), axis1=1, axis2=2))
    truth = np.concatenate(
        [np.tile(symmetric_part(K).ravel(), (4, 1)), U0 + SLOPE * d + SQUARE * d**2], axis=1
    )
    assert np.abs((found - truth) / sd).max() < 4.5
    # The compiled C keeps what the fit has, over all temperatures.
    errors = [
        r.error_g for r in next(m for m in delivery.methods if m.method.name == "matrix").residuals
    ]
    assert delivery.calibration.recording is not None
    limit = delivery.model_error_g * 2.0 + 1e-6  # two axes of the method's error, and rounding
    assert np.abs(errors - delivery.calibration.recording.residual_g).max() < limit


def test_a_slow_ramp_does_not_dominate(tmp_path: Path) -> None:
    """Six sets at 20 degC beside one at each end weigh as the three temperatures do."""
    rows = cycle((-20.0, 20.0, 20.0, 20.0, 20.0, 20.0, 20.0, 60.0), poses=10)
    calibration = calibrated(unit_with(tmp_path / "U", rows))
    assert calibration.recording is not None
    assert len(calibration.recording.poses.poses) == 80
    found = calibration.thermal.constants_at(np.array([-20.0, 60.0]))[:, 9:]
    d = np.array([[-40.0], [40.0]])
    # A pose is good to 0.17 mg; ten of them at each end.
    assert np.abs(found - (U0 + SLOPE * d + SQUARE * d**2)).max() < 5e-3


def test_an_order_beyond_the_temperatures_is_refused(tmp_path: Path) -> None:
    more = '[thermal]\nmodel = "polynomial"\norder = 3\n'
    folder = unit_with(tmp_path / "U", cycle((0.0, 20.0, 40.0), poses=10), more)
    with pytest.raises(RefusedError, match="3 with poses at 3 temperatures; expected order 2 at"):
        calibrated(folder)


def test_a_range_beyond_the_poses_is_refused(tmp_path: Path) -> None:
    folder = unit_with(
        tmp_path / "U", cycle((0.0, 20.0), poses=10), "[thermal]\nrange_degc = [-40, 60]\n"
    )
    with pytest.raises(RefusedError, match="record poses further out: nothing is extrapolated"):
        calibrated(folder)


def test_a_steady_ramp_has_temperatures() -> None:
    """Each pose is 1 degC from the next: a temperature is what lies within 2 degC of its lowest."""
    ramp = np.arange(10.0)
    assert temperature_groups(ramp) == [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9]]
    assert temperature_groups(np.array([20.3, 40.0, 19.9, 20.0])) == [[2, 3, 0], [1]]


def test_a_bias_on_a_slow_ramp_is_seen(tmp_path: Path) -> None:
    """1 K a pose, up, down and up: 5 mg of bias are taken for temperature, not for noise."""
    random = np.random.default_rng(3)
    minutes = np.arange(72.0)
    temps = 0.4 + np.minimum(minutes % 48.0, 48.0 - minutes % 48.0)
    bias = U0 + 0.05 * temps[:, None] / 25.0 * [1.0, -1.0, 1.0]
    readings = directions(72, seed=3) @ K.T + bias + 2e-3 * random.standard_normal((72, 3))
    recording = COLUMNS.replace('time = "t"', 'rows = "poses"\ntemperature = "T"')
    rows = np.column_stack([minutes, readings, temps])
    calibration = calibrated(write_unit(tmp_path / "U", rows, recording, header="t,ax,ay,az,T"))
    assert calibration.shape.order >= 1
    assert calibration.recording is not None
    # Readings of 0.2 mg; the bias alone is 3 mg rms.
    assert (calibration.recording.left_out_length_g or 1.0) < 0.4e-3


def slow_left_out(
    readings: FloatArray, temps: FloatArray, groups: FloatArray, gains: int
) -> FloatArray:
    """|a| - g of each group left out in turn, by plain least squares; `gains` terms in K."""
    d = (temps - 20.0) / 40.0

    def residual(theta: FloatArray, rows: FloatArray) -> FloatArray:
        powers = np.stack([np.ones(rows.sum()), d[rows]], axis=1)
        six = powers[:, :gains] @ theta[: 6 * gains].reshape(gains, 6)
        matrix = six[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)
        off = readings[rows] - powers @ theta[6 * gains :].reshape(2, 3)
        force = np.linalg.solve(matrix, off[:, :, None])[:, :, 0]
        result: FloatArray = np.linalg.norm(force, axis=1) - 1.0
        return result

    start = np.zeros(6 * gains + 6)
    start[:3] = 9.8
    errors = []
    for group in np.unique(groups):
        out = groups == group
        fit = least_squares(residual, start, args=(~out,), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        errors.append(residual(fit.x, out))
    return np.concatenate(errors)


def test_what_is_told_as_left_out_are_orientations_and_not_temperatures(tmp_path: Path) -> None:
    poses, temps = directions(12, seed=2), np.repeat(TEMPS, 12)
    d = temps[:, None] - 20.0
    noise = 5e-3 * np.random.default_rng(2).standard_normal((60, 3))
    # A square that the order of 1 misses: at the temperatures left out by more.
    readings = np.tile(poses, (5, 1)) @ K.T + U0 + 1e-4 * d**2 * [1.0, -1.0, 1.0] + noise
    more = '[thermal]\nmodel = "polynomial"\norder = 1\n'
    folder = write_unit(
        tmp_path / "U",
        np.column_stack([readings, temps]),
        COLUMNS.replace('time = "t"', 'rows = "poses"\ntemperature = "T"'),
        header="ax,ay,az,T",
        more=more + "[limits]\nat_t0_g = 0.1\nover_range_g = 0.1\n",
    )
    calibration = calibrated(folder)
    assert "12 orientations and 3 temperatures held out" in calibration.selection_reason
    recording = calibration.recording
    assert recording is not None
    gains = (next(c.parameters for c in calibration.candidates if c.chosen) - 6) // 6
    own = slow_left_out(readings, temps, np.tile(np.arange(12), 5), gains)
    expected = float(np.sqrt(np.mean(own**2)))
    # Beside a misfit of 8 mg, cross terms of 10 mrad and thermal terms feel their priors.
    assert recording.left_out_length_g == pytest.approx(expected, rel=0.08)
    assert (recording.held_out_g or 0.0) > 1.01 * recording.left_out_length_g


def test_the_order_of_averaged_rows_says_nothing(tmp_path: Path) -> None:
    """Back to 20 degC at the end, as on every bench, or sorted: the same rows, the same model."""
    random = np.random.default_rng(4)
    temps = np.repeat([20.0, 60.0, -20.0, 20.0], 14)
    d = temps[:, None] - 20.0
    poses = np.concatenate([directions(14, seed=n) for n in range(4)])
    readings = poses @ K.T + U0 + SLOPE * d + SQUARE * d**2
    readings += 1e-3 * random.standard_normal(readings.shape)
    recording = COLUMNS.replace('time = "t"', 'rows = "poses"\ntemperature = "T"')
    rows = np.column_stack([np.zeros(len(temps)), readings, temps])
    header = "t,ax,ay,az,T"
    chosen = []
    for name, ordered in (
        ("AS-MEASURED", rows),
        ("SORTED", rows[np.argsort(temps, kind="stable")]),
    ):
        made = calibrated(write_unit(tmp_path / name, ordered, recording, header=header))
        chosen.append(next(c.label for c in made.candidates if c.chosen))
    assert chosen[0] == chosen[1]
    assert "order 2" in chosen[0]


def test_t0_outside_of_the_poses_is_told(tmp_path: Path) -> None:
    made = calibrated(unit_with(tmp_path / "U", cycle((30.0, 40.0, 60.0))))
    assert made.recording is not None
    assert (
        "T0 = 20 degC lies outside of the poses' 30 to 60 degC: the constants there are "
        "extrapolated; state [thermal] t0_degc"
    ) in made.recording.findings


def test_kelvin_taken_for_degc_is_refused(tmp_path: Path) -> None:
    rows = cycle((0.0, 20.0, 40.0))
    rows[:, -1] += 273.15
    with pytest.raises(RefusedError) as refusal:
        calibrated(unit_with(tmp_path / "U", rows))
    assert str(refusal.value) == (
        f"{tmp_path}/U/unit.toml, [recording] temperature_unit: poses at 273.2 to 313.2 degC, "
        "and T0 at 20 "
        'degC; expected T0 among the poses\' temperatures; temperature_unit = "K" if they are '
        "kelvin, else state [thermal] t0_degc"
    )


@pytest.mark.parametrize(
    ("temps", "words"), [((0.0, 20.0, 50.0), ("between the temperatures not tested",)), (TEMPS, ())]
)
def test_three_temperatures_test_no_curve_between_them(
    tmp_path: Path, temps: tuple[float, ...], words: tuple[str, ...]
) -> None:
    """As of a tilter's unit: an inner temperature is held out where three remain."""
    folder = unit_with(tmp_path / "U", cycle(temps))
    delivery = deliver(folder)
    assert not_tested(delivery.unit, delivery.calibration) == words
