"""States that wander: their density against that of flicker noise, and what they are for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DEG_PER_H, MICRO_G, DataSheet
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


def test_white_noise_alone_moves_nothing() -> None:
    wander = wander_of(Layout(BASE), DataSheet(0.12, 50.0), DURATION_S)
    assert len(wander.columns) == 0
    assert wander.layout == Layout(BASE)
