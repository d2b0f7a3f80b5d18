"""[priors] of constants that follow temperature: the same whatever function they follow."""

from __future__ import annotations

import numpy as np
import pytest

from triaxcal.fitting.recorded.prior import LINEAR, Known
from triaxcal.fitting.recorded.scalar import ScalarData
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

TEMPS = np.linspace(-1.0, 1.0, 15) ** 3


def bias_covariance(basis: FloatArray) -> FloatArray:
    """Prior covariance of the bias of x over the poses, (n, n), in g^2."""
    count, P = basis.shape
    ones = np.ones(count)
    data = ScalarData(np.zeros((count, 3)), basis, ones, 1.0, np.zeros(3), 1.0)
    factor = Known(Priors(), 1.0, np.zeros(3)).of(LINEAR, data, 1).factor[6 : 6 + P]
    seen = basis @ factor
    result: FloatArray = seen @ seen.T
    return result


@pytest.mark.parametrize("functions", [2, 3, 4])
def test_a_constant_varies_as_much_by_any_function(functions: int) -> None:
    sd2 = Priors().bias_g ** 2
    powers = np.vander(TEMPS, functions, increasing=True)
    turned = powers @ np.random.default_rng(1).standard_normal((functions, functions))
    for basis in (powers, turned):
        covariance = bias_covariance(basis)
        # The mean over the poses has sd; what varies about it once more, however many functions.
        assert covariance.mean() == pytest.approx(sd2)
        assert np.diag(covariance).mean() == pytest.approx(2.0 * sd2)


def test_a_constant_alone_has_the_stated_standard_deviation() -> None:
    covariance = bias_covariance(np.ones((15, 1)))
    assert covariance == pytest.approx(np.full((15, 15), Priors().bias_g ** 2))
