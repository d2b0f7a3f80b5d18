"""States that wander: their density against that of flicker noise, and what they are for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dynamic_cases import changed, mems_short, sheet
from dynamic_judge import true_constants
from hand_motion import shaped_flicker
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import BASE, DEG_PER_H
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.instability import usual
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import INCREMENT, ImuRecording
from triaxcal.dynamic.wander import FLOOR, LONGEST, wander_of

SHEET = DataSheet(0.12, 50.0, gyro_bias_instability_deg_per_h=1.6, accel_bias_instability_ug=12.0)
DURATION_S = 200.0


def test_the_sum_of_states_has_the_density_of_flicker() -> None:
    wander = wander_of(Layout(BASE), SHEET, DURATION_S)
    for kind, B in (("rate", 1.6 * DEG_PER_H / FLOOR), ("force", 12 * MICRO_G / FLOOR)):
        mine = [kind in wander.layout.states[c].name for c in wander.columns[::3]]
        memory, sd = wander.memory_s[::3][mine], wander.sd[::3][mine]
        w = np.geomspace(2 / memory[-1], 0.5 / memory[0], 30)
        density = (2 * sd**2 * memory / (1 + (w[:, None] * memory) ** 2)).sum(axis=1)
        # Ripple 5.5 %; the ends of the sum, half a ratio outside, lack atan(2/sqrt(10))/(pi/2)
        # of a decade there: below 25 %.
        assert np.abs(density * w / B**2 - 1).max() < 0.3
        assert np.abs(np.median(density * w / B**2) - 1) < 0.06
        assert memory[-1] == pytest.approx(LONGEST * DURATION_S)


def test_states_move_as_gauss_markov_and_random_walk() -> None:
    sheet = replace(
        SHEET, gyro_random_walk_deg_per_h_per_sqrt_h=2.0, accel_random_walk_ug_per_sqrt_h=30.0
    )
    wander = wander_of(Layout(BASE), sheet, DURATION_S)
    once, twice = wander.over(7.0), wander.over(14.0)
    np.testing.assert_allclose(once[0] ** 2, twice[0], rtol=1e-12)
    np.testing.assert_allclose((once[0] * once[1]) ** 2 + once[1] ** 2, twice[1] ** 2, rtol=1e-12)
    walks = np.isinf(wander.memory_s)
    assert wander.columns[walks].tolist() == [9, 10, 11, 0, 1, 2]
    # After an hour K sqrt(1 h).
    hour = wander.over(3600.0)[1][walks]
    np.testing.assert_allclose(hour, np.repeat([2.0 * DEG_PER_H, 30.0 * MICRO_G], 3), rtol=1e-12)


def test_a_night_between_two_recordings_forgets_and_divides_by_no_zero() -> None:
    """The filter divides by the factor: at exp(-745) it would be zero."""
    wander = wander_of(Layout(BASE), SHEET, DURATION_S)
    factor, sd = wander.over(12 * 3600.0)
    assert 12 * 3600.0 / wander.memory_s.min() > 745
    assert factor.min() > 0
    shortest = wander.memory_s < 3600.0
    assert factor[shortest].max() < 1e-5
    np.testing.assert_allclose(sd[shortest], wander.sd[shortest], rtol=1e-4)


def test_white_noise_alone_moves_nothing() -> None:
    wander = wander_of(Layout(BASE), DataSheet(0.12, 50.0), DURATION_S)
    assert len(wander.columns) == 0
    assert wander.layout == Layout(BASE)


@cache
def flickering() -> tuple[dict[str, float], ImuRecording]:
    """A table recording with flicker of 6 deg/h and 60 micro-g, made apart from the estimator."""
    truth, recording = mems_short()
    samples = recording.all()
    rng = np.random.default_rng(16)
    step_s, n = 1 / recording.rate_hz, len(samples)
    gyro = shaped_flicker(rng, n, step_s, 6.0 * DEG_PER_H / FLOOR)
    accel = shaped_flicker(rng, n, step_s, 60.0 * MICRO_G / FLOOR)
    unit = [
        step_s if c == INCREMENT else 1.0 for c in (truth.rate_convention, truth.force_convention)
    ]
    rate, force = samples.rate + unit[0] * gyro, samples.force + unit[1] * accel
    return true_constants(truth), changed(recording, rate=rate, force=force)


def chi_square(result: DynamicResult, true: dict[str, float]) -> float:
    """Of the errors of the base model's constants."""
    names = [state.name for state in result.layout.states[:21]]
    error = result.p[:21] - np.array([true[name] for name in names])
    return float(error @ np.linalg.solve(result.covariance[:21, :21], error))


def test_flicker_is_found_and_covered() -> None:
    """Not stated: it is found within a factor of 1.7, and the constants are covered."""
    true, recording = flickering()
    white = calibrate_dynamic(recording, sheet(mems_short()[0]))
    noise = replace(
        sheet(mems_short()[0]), gyro_bias_instability_deg_per_h=None, accel_bias_instability_ug=None
    )
    result = calibrate_dynamic(recording, noise)
    # 21 constants: chi-square is beyond 46.8 once in 1000. White noise alone says far less.
    assert chi_square(result, true) < 46.8
    assert chi_square(white, true) > 46.8
    assert result.estimated == ("gyro_bias_instability_deg_per_h", "accel_bias_instability_ug")
    # Half a minute an axis: some ten independent pieces; ln B scatters by 1/sqrt(2 * 3 * 10) or so.
    found = result.noise.gyro_bias_instability_deg_per_h, result.noise.accel_bias_instability_ug
    assert found[0] is not None
    assert found[1] is not None
    assert 1 / 1.7 < found[0] / 6.0 < 1.7
    assert 1 / 1.7 < found[1] / 60.0 < 1.7


def test_without_flicker_less_than_the_usual_is_found() -> None:
    """Three minutes cannot exclude a small one, and do not take it for a usual one."""
    truth, recording = mems_short()
    found = calibrate_dynamic(recording, DataSheet()).noise
    true = sheet(truth)
    # Of the rests: 36 s, 180 differences in three axes; 6 % is three deviations and the counts.
    for name in ("gyro_arw_deg_per_sqrt_h", "accel_vrw_ug_per_sqrt_hz"):
        assert abs(getattr(found, name) / getattr(true, name) - 1) < 0.15
    keys = "gyro_bias_instability_deg_per_h", "accel_bias_instability_ug"
    expected = usual(replace(found, **dict.fromkeys(keys)))
    for name in keys:
        assert getattr(found, name) < 0.5 * getattr(expected, name)


def test_rests_without_noise_are_refused() -> None:
    _, recording = mems_short()
    samples = recording.all()
    coarse = 0.5 * np.rint(samples.force / 0.5)
    with pytest.raises(RefusedError, match="accelerometers read the same value throughout"):
        calibrate_dynamic(changed(recording, force=coarse), DataSheet())
