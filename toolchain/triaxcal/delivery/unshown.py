"""What readings cannot show by themselves: their scale, and which temperature is which."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import Priors

SCALE_SDS = 4.0
"""Of [priors] mean_scale: 1 of 16 000 units is farther off by chance. A factor of 2 either way is
5 or 10 of the default."""


def contradictions(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What is known beforehand and contradicts the result: the scale of readings in a known unit.

    Constants follow any scale, and residuals show none: a full scale or a unit that is not that of
    the readings.
    """
    nominal = None if unit.recording is None else unit.recording.reading_of_1_g
    if nominal is None:
        return ()
    K, _ = unpack_constants(calibration.thermal.constants_at(unit.t0_degc))
    # The geometric mean of the three, however the sensor is turned.
    mean = float(np.abs(np.linalg.det(K)) ** (1.0 / 3.0))
    prior, reading = unit.priors.mean_scale, calibration.reading_unit
    sds = abs(mean / nominal - 1.0) / prior
    if sds <= SCALE_SDS:
        return ()
    default = " (the default)" if prior == Priors().mean_scale else ""
    words = (
        f"1 g reads {mean:.3g} {reading} where {nominal:.6g} {reading} is nominal, {sds:.2g} "
        f"standard deviations of [priors] mean_scale = {prior:g}{default}: check unit and full "
        "scale of the readings, or state mean_scale"
    )
    return (words,)


def temperatures_untested(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """That temperatures might be exchanged, where curves pass through all of them.

    Nothing is held out then: curves through the readings of two exchanged temperatures fit as well.
    Said where it would matter: where the constants of one temperature are wrong at another by more
    than the limit.
    """
    test, points = calibration.held_out, calibration.points
    redundant = len(points) > calibration.shape.parameters
    if calibration.recording is not None or redundant or not (test is None or not test.between):
        return ()
    pairs = permutations([p.constants for p in points], 2)
    largest_g = max((_component_error_g(a, b) for a, b in pairs), default=0.0)
    if largest_g <= unit.limits.over_range_g:
        return ()
    wrong = f"with two exchanged, a component is up to {largest_g * 1e3:.2g} mg wrong"
    return (f"which temperature is which not tested: {wrong}",)


def _component_error_g(at: FloatArray, used: FloatArray) -> float:
    """Largest error of a component at 1 g where the constants (12,) `used` are not those `at`."""
    (K, U0), (L, V0) = unpack_constants(at), unpack_constants(used)
    of_force = np.linalg.solve(L, K) - np.eye(3)
    offset = np.linalg.solve(L, U0 - V0)
    return float((np.linalg.norm(of_force, axis=1) + np.abs(offset)).max())
