"""Directions that a recording did not see are named, and pairs known only together."""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.observability import observability
from triaxcal.dynamic.registry import extensions

LAYOUT = Layout((*BASE, *extensions()["elastic-gyro"].blocks))
NAMES = [state.name for state in LAYOUT.states]


def covariance(measured: dict[tuple[str, ...], float]) -> np.ndarray:
    """Of the priors, and of measurements of sums of states in units of their priors."""
    information = np.eye(len(NAMES))
    for names, sd in measured.items():
        row = np.array([1.0 if name in names else 0.0 for name in NAMES])
        information += np.outer(row, row) / sd**2
    prior = LAYOUT.prior_sd
    found: np.ndarray = np.linalg.inv(information) * np.outer(prior, prior)
    return found


def test_everything_seen() -> None:
    seen = observability(LAYOUT, covariance({(name,): 1e-3 for name in NAMES}))
    assert seen.unseen == ()
    assert seen.together == ()
    np.testing.assert_allclose(seen.gain, np.sqrt(1 + 1e6), rtol=1e-9)


def test_a_sum_alone_is_seen() -> None:
    """K22 + K33 and no more: the difference keeps its prior, and the two are one another's."""
    single = {(name,): 1e-3 for name in NAMES if name not in {"K22", "K33"}}
    seen = observability(LAYOUT, covariance({**single, ("K22", "K33"): 1e-3}))
    assert [set(names) for names in seen.unseen] == [{"K22", "K33"}]
    ((first, second, correlation),) = seen.together
    assert {first, second} == {"K22", "K33"}
    assert correlation < -0.99


def test_a_state_that_nothing_measures() -> None:
    seen = observability(LAYOUT, covariance({(n,): 1e-3 for n in NAMES if n != "Theta33"}))
    assert seen.unseen == (("Theta33",),)
    assert abs(seen.gain[NAMES.index("Theta33")] - 1.0) < 1e-9
