"""The prior of an update: what the budget of a calibration knows is in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_units import simulated
from triaxcal.fitting.field.update import Drift
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.expected import OF_THE_POSE
from triaxcal.uncertainty.explain import Parts
from triaxcal.uncertainty.fieldprior import field_prior
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance
from triaxcal.unit.description import UnitDescription

NONE = Drift(1e-12, 1e-12, 1e-12)


def budget_g(parts: Parts) -> float:
    """Standard uncertainty of |a| at T0 by the budget, rms over all orientations."""
    unit, measurements, calibration = parts
    found = uncertainty(unit, measurements, calibration, None, np.array([unit.t0_degc]))
    shared = [s for s in found.sources if s.force is not None and s.key not in OF_THE_POSE]
    total = sum(force_variance(s.force, DIRECTIONS)[0, :, 3] for s in shared)  # type: ignore[arg-type]
    return float(np.sqrt(np.mean(total)))


def parts_of(unit: UnitDescription, measurements: MeasurementSet) -> Parts:
    return unit, measurements, calibrate(unit, measurements, None)


@pytest.mark.parametrize(("fault", "bump_g"), [("none", 0.0), ("none", 2e-4), ("own_square", 0.0)])
def test_it_knows_all_that_the_budget_knows(fault: str, bump_g: float) -> None:
    """A source counts as large as where it is largest: at T0 the prior is no smaller."""
    unit, measurements, _ = simulated(fault, 3e-3, 3, 5, bump_g=bump_g)
    parts = parts_of(unit, measurements)
    squares = parts[2].squares
    assert squares is not None
    assert squares.included == (fault == "own_square")
    prior = field_prior(parts, NONE)
    assert len(prior.state.theta) == 12 * prior.state.functions + 18 * squares.included
    ratio = prior.length_g(prior.factory + prior.thermal, unit.t0_degc) / budget_g(parts)
    assert 1.0 - 1e-9 <= ratio < 1.6
    assert prior.thermal.any() or not bump_g


def test_a_gravity_that_is_known_badly_is_in_every_scale() -> None:
    unit, measurements, _ = simulated("none", 0.0, 3, 5)
    stated = replace(unit.stated, gravity_m_per_s2=0.02)
    good, bad = (
        field_prior(parts_of(replace(unit, stated=s), measurements), NONE)
        for s in (unit.stated, stated)
    )
    more = bad.length_g(bad.factory, 20.0) ** 2 - good.length_g(good.factory, 20.0) ** 2
    # 5e-5 m/s^2 is assumed where nothing is stated.
    expected = (0.02**2 - 5e-5**2) / 9.80665**2
    assert more == pytest.approx(expected, rel=0.05)
