"""dT/dt and its uncertainty."""

from __future__ import annotations

import math

import numpy as np
import pytest

from triaxcal.rig.plan.plan import Thermal
from triaxcal.rig.session.equilibrium import Trend, time_left_s, trend, window_s

T = np.arange(300.0)


def noise(seed, count=300):
    # Ten readings of 0.01 degC a second, in codes of 1/128 degC.
    readings = 0.01 * np.random.default_rng(seed).standard_normal((count, 10))
    return np.rint(readings * 128).mean(axis=1) / 128


@pytest.mark.parametrize("slope", [0.0, 0.012, -0.015, 0.1])
def test_slope_within_three_u(slope):
    off = []
    for seed in range(200):
        found = trend(T, 20.0 + slope * T / 60.0 + noise(seed), Thermal())
        off.append((found.slope_k_per_min - slope) / found.u_k_per_min)
    # Standard normal: 200 of them have a deviation of 1 within 3.5 / sqrt(400).
    assert 0.82 < np.std(off) < 1.18


def test_drift_above_the_limit_is_never_rest():
    for seed in range(200):
        found = trend(T, 20.0 + 0.025 * T / 60.0 + noise(seed), Thermal())
        assert not found.rests(Thermal())


def test_rest_is_seen():
    rests = [trend(T, 20.0 + noise(seed), Thermal()).rests(Thermal()) for seed in range(200)]
    assert all(rests)


def test_a_chamber_that_cycles_is_seen_through_when_its_period_is_known():
    cycling = 0.15 * np.sin(2 * math.pi * np.arange(360) / 120 + 0.7) + noise(1, 360)
    settings = Thermal(cycle_s=120)
    assert window_s(settings) == 360
    still = trend(np.arange(360), 20.0 + cycling, settings)
    moving = trend(np.arange(360), 20.0 + cycling + 0.03 * np.arange(360) / 60, settings)
    assert still.rests(settings)
    assert not moving.rests(settings)


@pytest.mark.parametrize("phase", np.linspace(0.0, 6.0, 13))
def test_an_unknown_cycle_does_not_pass_for_rest(phase):
    cycling = 0.15 * np.sin(2 * math.pi * T / 120 + phase) + noise(2)
    assert not trend(T, 20.0 + cycling, Thermal()).rests(Thermal())


def test_time_left_is_tau_ln_of_the_ratio():
    # Slope 2 K/min falling with 600 s: limit 0.02 after 600 ln 100.
    before, now = Trend(2.0 * math.exp(0.1), 0.0), Trend(2.0, 0.0)
    assert time_left_s(now, before, 60.0, Thermal()) == pytest.approx(600 * math.log(100))
    assert time_left_s(before, now, 60.0, Thermal()) is None
    assert time_left_s(Trend(0.01, 0.0), now, 60.0, Thermal()) == 0.0
