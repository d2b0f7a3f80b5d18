"""Which temperature is which: unknown where curves pass through all of them."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.source import Source
from triaxcal.unit.description import UnitDescription


def exchanged_error_g(unit: UnitDescription, calibration: Calibration) -> float | None:
    """Largest error of a component if two temperatures were exchanged; None where it is tested.

    Nothing is held out where curves pass through all temperatures: curves through the readings of
    two exchanged ones fit as well. None too where it does not matter: where the constants of one
    temperature are wrong at another by no more than the limit.
    """
    test, points = calibration.held_out, calibration.points
    redundant = len(points) > calibration.shape.parameters
    if calibration.recording is not None or redundant or not (test is None or not test.between):
        return None
    pairs = permutations([p.constants for p in points], 2)
    largest_g = max((_component_error_g(a, b) for a, b in pairs), default=0.0)
    return None if largest_g <= unit.limits.over_range_g else largest_g


def exchanged_source(unit: UnitDescription, calibration: Calibration) -> list[Source]:
    """That temperatures may be exchanged: of unknown size, as the readings do not show it."""
    largest_g = exchanged_error_g(unit, calibration)
    if largest_g is None:
        return []
    return [
        Source(
            key="exchanged_temperatures",
            name="the order of the temperatures",
            unit="g",
            advice="measure at one more temperature, or check positions at temperatures in between",
            origin=f"unknown: with two exchanged, a component is up to {largest_g * 1e3:.2g} mg "
            "wrong",
        )
    ]


def _component_error_g(at: FloatArray, used: FloatArray) -> float:
    """Largest error of a component at 1 g where the constants (12,) `used` are not those `at`."""
    (K, U0), (L, V0) = unpack_constants(at), unpack_constants(used)
    of_force = np.linalg.solve(L, K) - np.eye(3)
    offset = np.linalg.solve(L, U0 - V0)
    return float((np.linalg.norm(of_force, axis=1) + np.abs(offset)).max())
