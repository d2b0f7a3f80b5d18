"""The three estimators against P1 (10) written out, against a solver, and their covariance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fit_cases import TABLES, random_constants
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.tilter.estimators import (
    constants_covariance,
    constants_of,
    design_matrix,
    estimator_operators,
    pooled_variance,
    refuse_ill_conditioned,
)
from triaxcal.model.metrological import CONSTANT_NAMES, unpack_constants, voltage_from_force
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.unit.choices import ESTIMATORS

EPS = np.finfo(float).eps
FORCES = np.array(list(TEST_POSITIONS.values()), dtype=float)
seeds = st.integers(0, 2**32 - 1)


def equation_10(U, g):
    """P1 (10), letter by letter; U[i, d - 1] is output i in TPd."""
    x, y, z = U
    K = [
        [x[5] - x[4], x[3] - x[1], x[0] - x[2]],
        [y[5] - y[4], y[3] - y[1], y[0] - y[2]],
        [z[5] - z[4], z[3] - z[1], z[0] - z[2]],
    ]
    bias = [
        0.25 * (x[0] + x[1] + x[2] + x[3]),
        0.25 * (y[0] + y[2] + y[4] + y[5]),
        0.25 * (z[1] + z[3] + z[4] + z[5]),
    ]
    return np.concatenate([0.5 / g * np.ravel(K), bias])


@given(seeds, st.floats(0.97, 1.03))
def test_equation_10_is_the_printed_one(seed, g):
    voltage = np.random.default_rng(seed).normal(size=(6, 3))
    operators = estimator_operators("equation-10", g, None, 1)
    # Sums of at most four readings below 5 V: a few roundings of that size.
    np.testing.assert_allclose(
        constants_of(operators, voltage[None])[0], equation_10(voltage.T, g), atol=40 * EPS, rtol=0
    )


@given(seeds)
def test_half_sum_is_the_mean_of_the_axis_own_positions(seed):
    voltage = np.random.default_rng(seed).normal(size=(6, 3))
    operators = estimator_operators("half-sum", 1.0, None, 1)
    bias = constants_of(operators, voltage[None])[0, 9:]
    (x, y, z) = voltage.T
    expected = [(x[4] + x[5]) / 2, (y[1] + y[3]) / 2, (z[0] + z[2]) / 2]
    np.testing.assert_allclose(bias, expected, atol=20 * EPS, rtol=0)


@given(seeds, st.booleans())
def test_least_squares_is_that_of_a_solver(seed, weighted):
    random = np.random.default_rng(seed)
    voltage = random.normal(size=(2, 6, 3))
    variance = 10.0 ** random.uniform(-14, -10, (2, 6, 3)) if weighted else None
    constants = constants_of(estimator_operators("least-squares", 0.98, variance, 2), voltage)
    design = design_matrix(0.98)
    for g in range(2):
        for i in range(3):
            root = np.ones(6) if variance is None else 1.0 / np.sqrt(variance[g, :, i])
            solution = np.linalg.lstsq(root[:, None] * design, root * voltage[g, :, i])[0]
            mine = constants[g, [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]]
            # Weights over four decades: a normal matrix conditioned to 1e4, readings of 1 V.
            np.testing.assert_allclose(mine, solution, atol=1e5 * EPS * 10, rtol=0)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("g", [1.0, 0.9975])
def test_every_estimator_inverts_the_design(estimator, g):
    variance = np.random.default_rng(5).uniform(1, 2, (4, 6, 3))
    product = estimator_operators(estimator, g, variance, 4) @ design_matrix(g)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(4), (4, 3, 4, 4)), atol=20 * EPS)


@given(seeds, st.sampled_from(ESTIMATORS), st.floats(0.97, 1.03))
def test_exact_readings_give_back_the_constants(seed, estimator, g):
    truth = random_constants(np.random.default_rng(seed))
    voltage = voltage_from_force(truth, FORCES * g)
    found = constants_of(estimator_operators(estimator, g, None, 1), voltage[None])[0]
    np.testing.assert_allclose(found, truth, atol=20 * EPS * np.abs(voltage).max(), rtol=0)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_covariance_is_that_of_many_draws(estimator):
    random = np.random.default_rng(11)
    variance = random.uniform(0.5, 2.0, (1, 6, 3))
    operators = estimator_operators(estimator, 1.0, variance, 1)
    covariance = constants_covariance(operators, variance)[0]
    draws = 4000
    noise = random.normal(size=(draws, 6, 3)) * np.sqrt(variance)
    constants = constants_of(np.broadcast_to(operators, (draws, 3, 4, 6)), noise)
    sampled = constants.T @ constants / draws
    # An entry of a sample covariance has variance (c_ij^2 + c_ii c_jj) / n; 5 sd over 144 entries.
    diagonal = np.diag(covariance)
    sd = np.sqrt((covariance**2 + np.outer(diagonal, diagonal)) / draws)
    assert np.all(np.abs(sampled - covariance) < 5.0 * sd)
    # Outputs are independent: K_x. and K_y. do not covary.
    assert covariance[0, 3] == 0.0


def test_least_squares_is_never_worse_than_the_others():
    variance = np.random.default_rng(3).uniform(0.1, 3.0, (5, 6, 3))
    best = constants_covariance(estimator_operators("least-squares", 1.0, variance, 5), variance)
    for estimator in ("equation-10", "half-sum"):
        other = constants_covariance(estimator_operators(estimator, 1.0, variance, 5), variance)
        # Gauss-Markov: the difference has no negative eigenvalue, but for rounding.
        assert np.linalg.eigvalsh(other - best).min() > -100 * EPS


def test_pooled_variance_is_unbiased():
    sd = np.array([1.0, 2.0, 0.5])
    groups = 3000
    voltage = voltage_from_force(TABLES[1], FORCES) + 0.0
    noisy = voltage + sd * np.random.default_rng(2).normal(size=(groups, 6, 3))
    # chi-square with 2 groups degrees of freedom: relative sd 1 / sqrt(groups); 5 of them.
    np.testing.assert_allclose(pooled_variance(noisy), sd**2, rtol=5.0 / np.sqrt(groups))


def test_a_sound_unit_is_not_refused():
    refuse_ill_conditioned("m.csv", 20.0, TABLES[1])
    uneven = TABLES[1].copy()
    uneven[:3] *= 0.01  # an output of another sensitivity is no fault
    refuse_ill_conditioned("m.csv", 20.0, uneven)


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
@pytest.mark.parametrize("size", [0.0, 1e-3])
def test_outputs_that_look_alike_are_named(pair, size):
    constants = TABLES[1].copy()
    a, b = pair
    constants[3 * b : 3 * b + 3] = -2.0 * constants[3 * a : 3 * a + 3]
    constants[3 * b + b] += size
    with pytest.raises(RefusedError) as caught:
        refuse_ill_conditioned("m.csv, rows 1 to 6", 20.0, constants)
    names = f"outputs U{'xyz'[a]} and U{'xyz'[b]} respond alike"
    assert names in str(caught.value)
    assert str(caught.value).startswith("m.csv, rows 1 to 6: K at 20 degC has condition number")


def test_three_outputs_along_one_plane():
    constants = np.zeros(12)
    constants[:9] = [1, 0, 0, 0, 1, 0, 0.7, 0.7, 1e-4]
    with pytest.raises(RefusedError, match="the three sensing axes lie in one plane"):
        refuse_ill_conditioned("m.csv", 20.0, constants)


@pytest.mark.parametrize("axis", range(3))
def test_a_dead_output_is_named(axis):
    constants = TABLES[1].copy()
    constants[3 * axis : 3 * axis + 3] = 1e-9
    with pytest.raises(RefusedError, match=f"U{'xyz'[axis]} does not respond to gravity at 20"):
        refuse_ill_conditioned("m.csv", 20.0, constants)


def test_condition_limit():
    # K^T K = [[1, c], [c, 1]] in the plane of x and y: cond = sqrt((1 + c) / (1 - c)).
    def tilted(condition):
        c = (condition**2 - 1.0) / (condition**2 + 1.0)
        constants = np.zeros(12)
        constants[:9] = [1, 0, 0, c, np.sqrt(1 - c**2), 0, 0, 0, 1]
        return constants

    K, _ = unpack_constants(tilted(99.0))
    assert np.linalg.cond(K) == pytest.approx(99.0, rel=1e-9)
    refuse_ill_conditioned("m.csv", 20.0, tilted(99.0))
    with pytest.raises(RefusedError):
        refuse_ill_conditioned("m.csv", 20.0, tilted(101.0))


def test_names_and_order():
    assert CONSTANT_NAMES[3] == "Kyx"
    operators = estimator_operators("equation-10", 1.0, None, 1)
    voltage = np.zeros((1, 6, 3))
    voltage[0, 5, 1], voltage[0, 4, 1] = 1.0, -1.0  # Uy follows x: Kyx
    np.testing.assert_array_equal(constants_of(operators, voltage)[0], np.eye(12)[3])
