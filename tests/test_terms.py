"""Quadratic and dT/dt terms, and the IMU's model, in floats: against the equations written out."""

from __future__ import annotations

import numpy as np
import pytest

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.compensation import compensate
from triaxcal.model.methods.imu import ImuModel, compensate_imu, constants_from_errors
from triaxcal.model.terms import NO_TERMS, PRODUCT_NAMES, RateTerm, Terms, products

RANGE = (-40.0, 85.0)


def triad(seed: int, size: float) -> ThermalModel:
    """K near the unit matrix and U0 near nothing, each a straight line in T."""
    rng = np.random.default_rng(seed)
    constant = constants_from_errors(rng.normal(0, size, 3), rng.normal(0, size, (3, 3)))
    lines = np.stack([constant, rng.normal(0, size / 100, 12)], axis=1)[None]
    return ThermalModel(20.0, PiecewisePolynomial(RANGE, (20.0,), lines))


def test_products_are_named() -> None:
    vector = {"x": 2.0, "y": 3.0, "z": 5.0}
    expected = [vector[a] * vector[b] for a, b in map(tuple, PRODUCT_NAMES)]
    assert products(np.array(list(vector.values()))).tolist() == expected


def test_terms_are_the_equations_of_their_docstring() -> None:
    rng = np.random.default_rng(5)
    Q, r = rng.normal(size=(3, 6)), rng.normal(size=3)
    terms = Terms(Q, RateTerm(r, (-0.5, 0.25)))
    linear = rng.normal(size=(7, 3))
    rate = np.array([-2.0, -0.5, -0.1, 0.0, 0.1, 0.25, 1.0])
    clamped = [-0.5, -0.5, -0.1, 0.0, 0.1, 0.25, 0.25]
    for found, given, dt in zip(terms.force_g(linear, rate), linear, clamped, strict=True):
        x, y, z = given + r * dt
        p = [x * x, y * y, z * z, x * y, x * z, y * z]
        expected = [v + sum(q * m for q, m in zip(row, p, strict=True))
                    for v, row in zip((x, y, z), Q, strict=True)]  # fmt: skip
        # A dozen operations on numbers of order ten.
        assert np.abs(found - expected).max() < 1e-13


def test_no_terms_change_nothing() -> None:
    linear = np.array([1.0, 2.0, 3.0])
    assert NO_TERMS.force_g(linear, 1.0) is linear


def test_terms_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="three rows of six"):
        Terms(np.zeros((6, 3)))
    for range_k_per_s in ((0.1, 1.0), (0.0, 0.0), (-1.0, -0.5)):
        with pytest.raises(ValueError, match="a range about zero"):
            RateTerm(np.zeros(3), range_k_per_s)


def test_evaluate_inverts_the_metrological_model_and_adds_the_terms() -> None:
    thermal = triad(1, 0.02)
    Q = np.full((3, 6), 1e-3)
    compensation = compensate(thermal, "inverse", RANGE, 1.0, 1e-6, terms=Terms(Q))
    force = np.array([0.3, -0.5, 0.8])
    K = thermal.constants_at(50.0)[:9].reshape(3, 3)
    voltage = K @ force + thermal.constants_at(50.0)[9:]
    expected = force + Q @ products(force)
    assert np.abs(compensation.evaluate(voltage, 50.0) - expected).max() < 1e-14


def test_an_imu_gives_back_what_its_errors_were_made_of() -> None:
    """P2 (1), (2): readings w' = w + nu0 + Theta w of a gyro that also feels G a."""
    accel, gyro = triad(2, 0.02), triad(3, 0.02)
    G = np.random.default_rng(4).normal(0, 1e-3, (3, 3))
    model = ImuModel(accel, gyro, G)
    imu = compensate_imu(model, "inverse", RANGE, (2.0, 2.0), (1e-6, 1e-6))
    force, rate = np.array([0.1, 0.9, -0.4]), np.array([1.5, -0.2, 0.7])
    for temp in (-40.0, 20.0, 85.0):
        K_f, U0_f = accel.constants_at(temp)[:9].reshape(3, 3), accel.constants_at(temp)[9:]
        K_w, U0_w = gyro.constants_at(temp)[:9].reshape(3, 3), gyro.constants_at(temp)[9:]
        found = imu(K_f @ force + U0_f, K_w @ (rate + G @ force) + U0_w, temp)
        assert np.abs(found[0] - force).max() < 1e-14
        assert np.abs(found[1] - rate).max() < 1e-14


def test_an_imu_needs_nine_g_sensitivities() -> None:
    with pytest.raises(ValueError, match="three rows of three"):
        ImuModel(triad(2, 0.02), triad(3, 0.02), np.zeros(9))
