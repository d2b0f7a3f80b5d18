"""The transient after switching on: its constants cover the truth, by least squares with noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from performance_cases import noise
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import mean_of_runs, sd_interval
from triaxcal.performance.transient import Transient, fit_transient

TIME = np.arange(2400) * 1.0


def run(seed: int, parts: list[tuple[float, float]], of: tuple[float, float, float]) -> FloatArray:
    """Exponentials (amplitude, time constant) about 1e6 in noise N, B, K."""
    random = np.random.default_rng(seed)
    values = 1e6 + noise(len(TIME), 1.0, of, random)
    for amplitude, tau in parts:
        values = values + amplitude * np.exp(-TIME / tau)
    return np.asarray(values)


@pytest.mark.long
@pytest.mark.parametrize("of", [(25.0, 0.0, 0.0), (25.0, 6.0, 0.3)], ids=["white", "coloured"])
def test_intervals_cover_the_truth(of: tuple[float, float, float]) -> None:
    """12 runs: at 95 %, 8 or fewer have a chance of 2e-3 each; the seeds are fixed."""
    tau, amplitude, band = 240.0, 900.0, 60.0
    hits = np.zeros(3)
    for seed in range(12):
        found = fit_transient(TIME, run(seed, [(amplitude, tau)], of))
        assert len(found.tau_s) == 1
        sd = np.sqrt(np.diag(found.covariance))
        settled, settled_sd = found.settled_s(band)
        hits += [
            abs(math.log(found.tau_s[0] / tau)) < 1.96 * sd[0],
            abs(found.amplitude[0] - amplitude) < 1.96 * sd[1],
            abs(settled - tau * math.log(amplitude / band)) < 1.96 * settled_sd,
        ]
    assert (hits > 8).all()


def test_two_time_constants_are_told_apart() -> None:
    found = fit_transient(TIME, run(1, [(800.0, 400.0), (-1500.0, 30.0)], (5.0, 0.0, 0.0)))
    sd = np.sqrt(np.diag(found.covariance))
    assert len(found.tau_s) == 2
    # Four standard deviations: one in 16 000.
    for k, (amplitude, tau) in enumerate([(-1500.0, 30.0), (800.0, 400.0)]):
        assert abs(math.log(found.tau_s[k] / tau)) < 4.0 * sd[k]
        assert abs(found.amplitude[k] - amplitude) < 4.0 * sd[2 + k]


def test_no_transient_is_not_seen() -> None:
    found = fit_transient(TIME, run(3, [], (25.0, 6.0, 0.1)))
    assert len(found.tau_s) == 0
    assert found.settled_s(60.0) == (0.0, 0.0)
    assert 5.0 < found.limit < 200.0
    assert found.steady == pytest.approx(1e6, abs=50.0)


def test_the_time_to_settle_is_the_last_crossing() -> None:
    """Two exponentials that cross: the overshoot counts. By a fine grid."""
    t = Transient(np.array([20.0, 300.0]), np.array([900.0, -500.0]), 1e-6 * np.eye(4), 0.0, 0.0)
    grid = np.linspace(0.0, 3000.0, 3_000_001)
    outside = np.abs(900.0 * np.exp(-grid / 20.0) - 500.0 * np.exp(-grid / 300.0)) > 60.0
    assert t.settled_s(60.0)[0] == pytest.approx(grid[outside][-1], abs=2e-3)
    # Of the slow part alone by then: sd of t = tau sd(ln tau) ln(A / band) + ..., both 1e-3.
    slope = 300.0 * math.hypot(math.log(500.0 / 60.0), 1.0 / 500.0)
    assert t.settled_s(60.0)[1] == pytest.approx(1e-3 * slope, rel=1e-3)


def test_runs_that_are_within_the_band_from_the_start_have_a_mean() -> None:
    """Such a run settles at 0 s, with an uncertainty of 0: no weight can be made of it."""
    assert mean_of_runs(np.zeros(2), np.zeros(2)) == (0.0, 0.0)
    mean, expanded = mean_of_runs(np.array([0.0, 12.0]), np.array([0.0, 1.0]))
    assert (mean, expanded) == (6.0, pytest.approx(1.96 / 2.0))


def test_means_of_runs_and_standard_deviations() -> None:
    values = np.array([1.0, 2.0, 4.0, 5.0])
    mean, expanded = mean_of_runs(values, np.ones(4))
    assert (mean, expanded) == (3.0, pytest.approx(3.18245 * math.sqrt(10.0 / 3.0) / 2.0, rel=1e-4))
    assert mean_of_runs(values[:2], np.array([1.0, 2.0])) == (
        pytest.approx(1.2), pytest.approx(1.96 / math.sqrt(1.25)),
    )  # fmt: skip
    # chi^2 of 9: 2.7004 and 19.0228, tables.
    low, high = sd_interval(1.0, 9.0)
    assert (low, high) == (pytest.approx(3.0 / math.sqrt(19.0228), rel=1e-5),
                           pytest.approx(3.0 / math.sqrt(2.7004), rel=1e-4))  # fmt: skip
