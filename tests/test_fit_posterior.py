"""Least squares with a prior: against the closed form, and the noise scale of few data."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import polygamma

from triaxcal.fitting.core.noise import Linearised, NoisePrior, trigamma
from triaxcal.fitting.core.posterior import Posterior, Prior, fit_map
from triaxcal.model.types import FloatArray


def linear(
    design: FloatArray, values: FloatArray, prior: Prior, scale: float | None = None
) -> Posterior:
    return fit_map(
        lambda theta: (design @ theta - values, design),
        prior,
        np.ones(len(values)),
        scale=scale,
    )


def problem(rows: int, seed: int = 0) -> tuple[FloatArray, FloatArray, Prior]:
    random = np.random.default_rng(seed)
    design = random.standard_normal((rows, 4))
    half = random.standard_normal((4, 4)) * 1e-2
    prior = Prior.of(np.array([1.0, 0.0, -1.0, 2.0]), half @ half.T)
    truth = prior.mean + prior.factor @ random.standard_normal(prior.factor.shape[1])
    return design, design @ truth + 1e-3 * random.standard_normal(rows), prior


@pytest.mark.parametrize("rows", [2, 4, 5, 6, 30])
def test_the_probability_of_the_data_is_that_of_their_normal_distribution(rows: int) -> None:
    """One row more than constants among them: that is where a triangle begins to differ."""
    design, values, prior = problem(rows)
    B, y = design @ prior.factor, design @ prior.mean - values
    nodes = np.log([3e-4, 1e-3, 1e-2])
    found = Linearised.about(B, y, float(rows)).log_likelihood(nodes)
    for of, node in zip(found, nodes, strict=True):
        covariance = B @ B.T + np.exp(2.0 * node) * np.eye(rows)
        sign, determinant = np.linalg.slogdet(covariance)
        assert sign == 1.0
        wanted = -0.5 * (determinant + y @ np.linalg.solve(covariance, y))
        assert of == pytest.approx(wanted, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("rows", [2, 4, 5, 6, 30])
def test_a_linear_problem_has_the_closed_form(rows: int) -> None:
    design, values, prior = problem(rows)
    found = linear(design, values, prior, scale=1e-3)
    before = prior.factor @ prior.factor.T
    precision = np.linalg.inv(before) + design.T @ design / 1e-6
    covariance = np.linalg.inv(precision)
    right = np.linalg.inv(before) @ prior.mean + design.T @ values / 1e-6
    assert np.allclose(found.theta, covariance @ right, rtol=1e-9, atol=1e-12)
    assert np.allclose(found.covariance, covariance, rtol=1e-7, atol=1e-16)
    share = 1.0 - np.diag(covariance) / np.diag(before)
    assert np.allclose(found.share_of_data(np.eye(4)), share, atol=1e-9)


def test_a_constant_without_variance_stays_as_it_is() -> None:
    design, values, _ = problem(20)
    prior = Prior.of(np.array([1.0, 0.0, -1.0, 2.0]), np.diag([1e-4, 1e-4, 0.0, 1e-4]))
    found = linear(design, values, prior)
    assert found.theta[2] == -1.0
    assert found.covariance[2, 2] == 0.0


def test_the_noise_scale_is_that_of_the_residuals_where_they_are_many() -> None:
    design, values, prior = problem(400)
    found = linear(design, values, prior)
    residual = design @ np.linalg.lstsq(design, values)[0] - values
    assert found.scale == pytest.approx(math.sqrt((residual**2).sum() / 396), rel=0.01)
    assert found.dof == pytest.approx(396, rel=0.05)
    assert found.reach == pytest.approx(1.0, abs=0.02)


def test_the_noise_scale_is_not_below_its_floor() -> None:
    design, _, prior = problem(40)
    found = linear(design, design @ prior.mean, prior)
    assert found.scale >= 1e-4


def test_without_degrees_of_freedom_the_noise_is_what_was_known_beforehand() -> None:
    """Four values, four free constants: nothing is learned of the noise."""
    design, values, _ = problem(4)
    wide = Prior.of(np.zeros(4), 1e8 * np.eye(4))
    noise = NoisePrior(median=1e-3, spread=0.5, least=1e-6)
    found = fit_map(lambda t: (design @ t - values, design), wide, np.ones(4), noise)
    assert math.log(found.scale / 1e-3) == pytest.approx(0.0, abs=0.02)
    # A log-normal scale of spread 0.5: the 95 % quantile of |s z| by simulation.
    random = np.random.default_rng(0)
    drawn = np.exp(0.5 * random.standard_normal(400_000)) * random.standard_normal(400_000)
    quantile = float(np.quantile(np.abs(drawn), 0.95))
    assert found.reach * 1.959964 == pytest.approx(quantile, rel=0.02)
    assert found.dof == pytest.approx(3.0, rel=0.2)


def testtrigamma() -> None:
    for x in (0.5, 1.0, 3.7, 50.0):
        assert trigamma(x) == pytest.approx(float(polygamma(1, x)), rel=1e-7)


def test_a_nonlinear_problem_is_solved_from_the_prior_mean() -> None:
    random = np.random.default_rng(4)
    points = random.standard_normal((50, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    centre = np.array([0.09, -0.12, 0.05])
    values = points + centre + 2e-4 * random.standard_normal((50, 3))

    def model(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        away = values - theta
        length = np.linalg.norm(away, axis=1)
        return length - 1.0, -away / length[:, None]

    found = fit_map(model, Prior.of(np.zeros(3), 0.01 * np.eye(3)), np.ones(50))
    sd = np.sqrt(np.diag(found.covariance))
    assert np.abs((found.theta - centre) / sd).max() < 4.0
    assert sd.max() < 1e-4


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_finds_the_noise_of_normal_data(loss: str) -> None:
    """400 values: s is known to 1 / sqrt(792), the mean of eight of them to 1.3 %; three of it."""
    found = []
    for seed in range(8):
        design, values, prior = problem(400, seed)
        found.append(
            fit_map(
                lambda theta, A=design, y=values: (A @ theta - y, A), prior, np.ones(400), loss=loss
            ).scale
        )
    assert np.mean(found) == pytest.approx(1e-3, rel=3.0 / math.sqrt(2.0 * 396 * 8))
