"""What theory.md says about errors in the print of P1, measured on its own tables."""

from __future__ import annotations

import numpy as np
import pytest

from fit_cases import TABLES
from triaxcal.model.metrological import force_from_voltage, unpack_constants, voltage_from_force

K0, U00 = unpack_constants(TABLES[1])
N0 = np.linalg.inv(K0)
D = np.diag(K0)


def forces(count: int = 2000):
    vectors = np.random.default_rng(31).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def printed_second_matrix():
    """The matrix of P1 (2) that multiplies dU0, entry (1, 2) as printed: without K_xy."""
    matrix = np.diag(1.0 / D)
    for i in range(3):
        for j in range(3):
            if i != j:
                matrix[i, j] = -K0[i, j] / (D[i] * D[j])
    matrix[0, 1] = -1.0 / (D[0] * D[1])
    return matrix


def mended_second_matrix():
    matrix = printed_second_matrix()
    matrix[0, 1] = -K0[0, 1] / (D[0] * D[1])
    return matrix


def correction(row: int, voltage, second):
    """Delta_a of P1 (2), with dK = K(T) - K(T0) and dU0 = U0(T) - U0(T0) as (3), (12) have them."""
    K, U0 = unpack_constants(TABLES[row])
    first = (K - K0) / np.outer(D, D)
    return -(voltage - U00) @ first.T - second @ (U0 - U00)


def test_equation_2_needs_k_xy_in_its_entry_1_2():
    # The exact inverse, of which (2) is the first order in the cross sensitivities (0.03 of K).
    error = np.abs(mended_second_matrix() - N0)
    assert error.max() < 3 * 0.03**2 * np.abs(N0).max()
    assert abs(printed_second_matrix() - N0)[0, 1] > 100 * error[0, 1]


@pytest.mark.parametrize(
    ("row", "before_mg", "printed_mg", "mended_mg"), [(0, 14.2, 28.5, 0.059), (2, 5.2, 10.5, 0.114)]
)
def test_the_printed_sign_of_the_correction_doubles_the_error(
    row, before_mg, printed_mg, mended_mg
):
    """Largest error of a component over random orientations; 1 % is the sampling of these."""
    a = forces()
    voltage = voltage_from_force(TABLES[row], a)
    plain = force_from_voltage(TABLES[1], voltage)
    delta = correction(row, voltage, mended_second_matrix())
    corrected = (plain, plain - delta, plain + delta)
    largest = [1e3 * np.abs(x - a).max() for x in corrected]
    assert largest == pytest.approx([before_mg, printed_mg, mended_mg], rel=0.01)
