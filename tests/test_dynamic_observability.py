"""Directions that a recording did not see are named, and pairs known only together."""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.observability import observability
from triaxcal.report.dynamic import weak_words

LAYOUT = Layout((*BASE, *EXTENSIONS["elastic-gyro"].blocks))
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


def test_a_combination_that_is_known_badly_is_stated_with_its_sd() -> None:
    """D11 = D22 = D33 is a rate about the vertical: 98 each where the differences are to 1.4."""
    layout = Layout((*BASE, *EXTENSIONS["g-drift"].blocks))
    unit = layout.per_unit
    n = len(layout)
    place = layout.place("g-drift")
    common = np.zeros(n)
    common[[place.start, place.start + 4, place.start + 8]] = 98.0
    covariance = np.diag((1.4 * unit) ** 2) + np.outer(common * unit, common * unit)
    seen = observability(layout, covariance)
    assert seen.together == ()
    (weak,) = seen.weak
    assert weak.names == ("D11", "D22", "D33")
    assert abs(weak.sd_each - np.sqrt(98.0**2 + 1.4**2 / 3)) < 1e-6
    assert abs(weak.sd_next - 1.4) < 1e-9
    assert weak_words(weak) == (
        "a common change of D11 and D22 and D33 has a standard deviation of 98 deg/h/g each; every "
        "other combination has 1.4 deg/h/g or less: with the force along gravity it is a rate "
        "about the vertical, which only a heading shows; along a force of 1 g the gyros' rates are "
        "uncertain by as much. Recording "
        'the table\'s angle separates it (block "table-angles").'
    )
