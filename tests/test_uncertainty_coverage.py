"""Do the stated 95 % intervals hold the truth 95 % of the time? Seeded units, through the fit."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import force_from_voltage
from triaxcal.simulation.dwells import simulate
from triaxcal.simulation.rig import Rig
from triaxcal.simulation.truth import Imperfections, read_truth
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS
from triaxcal.unit.description import read_unit
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.uncertainty import StatedUncertainty

AT_SIM = Path(__file__).parent.parent / "units" / "AT-SIM"
TEMPS = np.array([-35.0, -5.0, 20.0, 48.0, 66.0])
EACH = 12
RIG = Imperfections(
    squareness_sd_arcsec=15.0,
    repeatability_sd_arcsec=3.0,
    level_sd_arcsec=10.0,
    gravity_sd_m_per_s2=5e-5,
    thermometer_offset_sd_degc=0.1,
)
DRIFT_DEGC = 0.02
STATED = StatedUncertainty(15.0, 3.0, 10.0, 5e-5, 0.1, DRIFT_DEGC)
TILTER_FROM_RESIDUALS = replace(STATED, squareness_arcsec=None, repeatability_arcsec=None)


@dataclass(frozen=True)
class Coverage:
    """Shares of intervals that hold the truth."""

    constants: float
    components: float
    length: float


def coverage(
    units: int,
    stated: StatedUncertainty,
    imperfections: Imperfections,
    *,
    auto: bool,
    readings: int = 30,
) -> Coverage:
    """Over seeds 0 to units - 1, all constants and orientations at `TEMPS`.

    In use the thermometer has its offset of the calibration and a drift; the force is computed as
    the device does, from the temperature shown.
    """
    unit = replace(read_unit(AT_SIM), stated=stated)
    if not auto:
        unit = replace(
            unit, thermal=ThermalChoice("polynomial", {"order": 3}), estimator="least-squares"
        )
    truth, plan = read_truth(AT_SIM)
    truth = replace(truth, imperfections=imperfections)
    directions = DIRECTIONS[::EACH]
    exact = truth.constants.constants_at(TEMPS)
    voltage = truth.voltage_v(directions[None], TEMPS[:, None])
    drift_degc = stated.thermometer_drift_degc or 0.0
    constants, forces = [], []
    for seed in range(units):
        measurements = simulate(unit, truth, replace(plan, seed=seed, readings_per_dwell=readings))
        calibration = calibrate(unit, measurements)
        found = uncertainty(unit, measurements, calibration, None, TEMPS)
        at = calibration.thermal.constants_at
        constants.append(np.abs(at(TEMPS) - exact) <= found.constants_u)
        drift = drift_degc * np.random.default_rng([seed, 2]).standard_normal()
        offset = Rig(imperfections, unit.gravity_g, seed).thermometer_offset_degc
        force = force_from_voltage(at(TEMPS + offset + drift)[:, None], voltage)
        length = np.linalg.norm(force, axis=-1, keepdims=True) - 1.0
        error = np.concatenate([force - directions, length], axis=-1)
        forces.append(np.abs(error) <= found.force_u[:, ::EACH])
    inside = np.array(forces)
    return Coverage(
        float(np.mean(constants)), float(inside[..., :3].mean()), float(inside[..., 3].mean())
    )


PERFECT = Coverage(constants=0.968, components=0.972, length=0.971)
"""Found for a perfect tilter left to the residuals. A variance that is zero comes out above zero in
half of the units and never below: on the safe side, for noise, repeatability, squareness and
thermal model together."""


def within(found: Coverage, most: Coverage | None = None) -> bool:
    """93 to 97 %, each. Values of one unit hang together, so it is like 500 to 1000 draws: 1 %."""
    limits = (0.97, 0.97, 0.97) if most is None else astuple(most)
    return all(0.93 <= s <= limit for s, limit in zip(astuple(found), limits, strict=True))


def one_standard_error_above(figure: Coverage, units: int) -> Coverage:
    """Of a share that so many units, one draw each, show; the seeds are fixed, so one is enough.

    Squareness counted as what noise could have hidden gave 97.5, 98.0 and 97.6 %: it fails in the
    constants (97.4 %) and in the components (97.7 %).
    """
    return Coverage(*(p + math.sqrt(p * (1.0 - p) / units) for p in astuple(figure)))


def test_intervals_of_500_units_hold_the_truth() -> None:
    found = coverage(500, STATED, RIG, auto=False)
    assert within(found), found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stated", "imperfections", "auto"),
    [
        (STATED, RIG, True),
        (TILTER_FROM_RESIDUALS, RIG, False),
        (StatedUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Imperfections(), False),
        (StatedUncertainty(None, None, 0.0, 0.0, 0.0, 0.0), Imperfections(), False),
        # As large as what the residuals of 30 readings a dwell can just show.
        (
            StatedUncertainty(None, None, 0.0, 0.0, 0.0, 0.0),
            Imperfections(squareness_sd_arcsec=0.4),
            False,
        ),
    ],
    ids=[
        "model chosen by auto",
        "tilter from the residuals",
        "noise alone",
        "a perfect tilter from the residuals",
        "a tilter that the residuals just show",
    ],
)
def test_intervals_of_1000_units_hold_the_truth(
    stated: StatedUncertainty, imperfections: Imperfections, auto: bool
) -> None:
    found = coverage(1000, stated, imperfections, auto=auto)
    perfect = imperfections == Imperfections() and stated.squareness_arcsec is None
    assert within(found, one_standard_error_above(PERFECT, 1000) if perfect else None), found


def test_the_limit_of_a_perfect_tilter_can_fail() -> None:
    """What was found while an unseen squareness was counted in does not pass; what is now does."""
    limit = one_standard_error_above(PERFECT, 1000)
    assert within(PERFECT, limit)
    assert not within(Coverage(0.975, 0.972, 0.971), limit)
    assert not within(Coverage(0.968, 0.980, 0.971), limit)


@pytest.mark.slow
def test_intervals_hold_with_three_readings_a_dwell() -> None:
    nothing = StatedUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    found = coverage(500, nothing, Imperfections(), auto=False, readings=3)
    assert within(found), found


def test_an_understated_rig_is_caught() -> None:
    """The test can fail: a tilter stated at a fifth of what it is holds far less than 93 %."""
    understated = replace(STATED, squareness_arcsec=3.0, level_arcsec=2.0)
    found = coverage(60, understated, RIG, auto=False)
    assert found.components < 0.7
