"""Scales of the priors that poses show, against integrals by brute force."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from family_cases import directions

from triaxcal.fitting.recorded.magnitude import fit_with_prior
from triaxcal.fitting.recorded.prior import FULL, LINEAR, OWN_SQUARES, Known
from triaxcal.fitting.recorded.scalar import GROUPS, ScalarModel, scalar_data
from triaxcal.fitting.recorded.scales import MOST_OF_A_UNIT, ScaleEvidence, scales_of
from triaxcal.fitting.recorded.terms import ODDS, scaled_by_poses
from triaxcal.fitting.recorded.trials import PoseClimate, Trial, judge
from triaxcal.model.thermal.polynomial import PolynomialShape
from triaxcal.unit.priors import FirmwareChoice, Priors

CROSS, SCALE = 1.5e-3, 0.015


def evidence_of(
    model: ScalarModel, count: int = 14, seed: int = 7, cross_rad: float = CROSS
) -> ScaleEvidence:
    random = np.random.default_rng(seed)
    cross = np.triu(cross_rad * random.standard_normal((3, 3)), 1)
    matrix = np.eye(3) + np.diag(SCALE * random.standard_normal(3)) + cross + cross.T
    poses = directions(count, seed=seed) @ matrix.T + 0.02
    poses += 5e-4 * random.standard_normal(poses.shape)
    data = scalar_data(poses, np.ones((count, 1)), np.ones(count), 1.0)
    data = replace(data, count=np.ones(count))
    known = Known(Priors(), 1.0, np.zeros(3))
    return ScaleEvidence(known, fit_with_prior(model, data, 1, known))


@pytest.mark.parametrize("model", [LINEAR, FULL], ids=["linear", "full"])
def test_the_probability_of_the_poses_is_that_of_their_joint_normal_distribution(
    model: ScalarModel,
) -> None:
    """Readings are N(at the prior's mean, s^2 + B B^T); over ln s by 2000 nodes."""
    found = evidence_of(model)
    fit, known = found.fit, found.known
    priors = replace(known.priors, cross_term_rad=2e-3, product_g_per_g2=1e-3)
    prior = replace(known, priors=priors).of(fit.model, fit.data, 1)
    B = fit.jacobian @ prior.factor
    y = fit.residual_g + fit.jacobian @ (prior.mean - fit.theta)
    nodes = np.linspace(math.log(known.noise.least), math.log(0.1), 2000)
    log = []
    for node in nodes:
        covariance = math.exp(2.0 * node) * np.eye(len(y)) + B @ B.T
        log.append(-0.5 * (np.linalg.slogdet(covariance)[1] + y @ np.linalg.solve(covariance, y)))
    density = np.array(log) + known.noise.log_density(nodes)
    brute = density.max() + math.log(
        np.exp(density - density.max()).sum() * float(nodes[1] - nodes[0])
    )
    # Both sums end at the least noise; a node of one of them is 5 % of its sd there.
    assert found.log_evidence(priors) == pytest.approx(brute, abs=1e-3)


def test_scales_and_their_probability_are_those_of_the_integral_over_them() -> None:
    found = evidence_of(LINEAR)
    scales = scales_of([found], found.known.priors)
    away = np.linspace(-4.5, 4.5, 46)
    log = np.array(
        [
            [
                found.log_evidence(
                    replace(
                        found.known.priors,
                        cross_term_rad=0.01 * math.exp(x),
                        scale_factor=0.02 * math.exp(y),
                    )
                )
                - 0.5 * (x * x + y * y)
                for y in away
            ]
            for x in away
        ]
    )
    share = np.exp(log - log.max())
    cell = float(away[1] - away[0]) ** 2 / (2.0 * math.pi)
    integral = log.max() + math.log(share.sum() * cell)
    # Laplace: a scale of three constants is skew, by some tenths of its sd.
    assert scales.log_evidence == pytest.approx(integral, abs=0.15)
    for key, axis in (("cross_term_rad", 1), ("scale_factor", 0)):
        along = share.sum(axis=axis) / share.sum()
        sd = math.sqrt(float(along @ (away - along @ away) ** 2))
        assert math.log(scales.factors[key]) == pytest.approx(sd, rel=0.2)
    top = np.unravel_index(int(log.argmax()), log.shape)
    assert scales.priors.cross_term_rad == pytest.approx(0.01 * math.exp(away[top[0]]), rel=0.12)
    assert scales.priors.scale_factor == pytest.approx(0.02 * math.exp(away[top[1]]), rel=0.12)


def test_what_the_poses_do_not_show_keeps_its_scale() -> None:
    """Six faces show no cross term, and one square only together with the bias."""
    found = evidence_of(FULL, count=6)
    scales = scales_of([found], found.known.priors)
    assert scales.priors.cross_term_rad == pytest.approx(0.010, rel=0.1)
    assert scales.priors.product_g_per_g2 == pytest.approx(3e-4, rel=0.1)
    assert scales.factors["cross_term_rad"] == pytest.approx(math.e, rel=0.1)


def test_a_series_far_from_the_defaults_shows_its_scale() -> None:
    """0.2 rad is 3 standard deviations of the hyperprior above the default; a unit stops at 2."""
    units = [evidence_of(LINEAR, seed=seed, cross_rad=0.2) for seed in range(10)]
    found = scales_of(units, Priors())
    # 30 numbers show a scale to 13 %; three of that, and what the hyperprior pulls: 3 sd^2.
    assert found.priors.cross_term_rad == pytest.approx(0.2, rel=0.45)
    assert 1.08 < found.factors["cross_term_rad"] < 1.25
    alone = scales_of(units[:1], Priors(), MOST_OF_A_UNIT)
    assert alone.priors.cross_term_rad == pytest.approx(0.010 * math.exp(2.0), rel=1e-6)
    assert set(alone.factors) == {"scale_factor"}


@pytest.mark.parametrize(("model", "groups"), [(LINEAR, 2), (OWN_SQUARES, 3), (FULL, 4)])
def test_a_model_knows_its_groups(model: ScalarModel, groups: int) -> None:
    assert model.groups == GROUPS[:groups]
    one = replace(model, quadratic=FULL.quadratic[1:2])
    assert one.groups == (*GROUPS[:2], "product_g_per_g2")


def odds_of_squares(seed: int, loss: str) -> float:
    """Ln of the odds for squares that are not there, of 24 poses with two wrong by 1 %."""
    random = np.random.default_rng(seed)
    poses = directions(24, seed=seed) + 3e-4 * random.standard_normal((24, 3))
    poses[random.choice(24, 2, replace=False)] *= 1.01
    data = scalar_data(poses + 0.02, np.ones((24, 1)), np.ones(24), 1.0)
    data = replace(data, count=np.ones(24))
    climate = PoseClimate(np.full(24, 20.0), None, loss)
    trial = Trial(
        FULL,
        PolynomialShape.over(np.full(24, 20.0), 20.0, 0),
        1,
        known=Known(Priors(), 1.0, np.zeros(3)),
    )
    full = judge(trial, data, climate, [])
    trials = [replace(trial, model=model) for model in (LINEAR, OWN_SQUARES, FULL)]
    linear, *others = (scaled_by_poses(t, data, climate, [], full.fit) for t in trials)
    return max(other.log_evidence for other in others) - linear.log_evidence


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_odds_under_a_robust_loss_are_of_one_set_of_weights(loss: str) -> None:
    odds = [odds_of_squares(seed, loss) for seed in range(12)]
    assert max(odds) < math.log(ODDS)


def test_the_key_states_the_odds_of_the_rule() -> None:
    assert f"the poses {ODDS:g} times as probable" in " ".join(str(FirmwareChoice.__doc__).split())
