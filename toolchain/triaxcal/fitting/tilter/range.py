"""The working range of temperatures: as stated, or that of the fitted dwells."""

from __future__ import annotations

import math

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.model.thermal.shape import EDGE_DEGC
from triaxcal.unit.description import UnitDescription

_STEP_DEGC = 0.1
"""A working range taken from the calibrated temperatures is rounded outward to this."""


def working_range(
    unit: UnitDescription, groups: tuple[TemperatureGroup, ...]
) -> tuple[float, float]:
    """Range of the description, or that of the dwells at its ends, in steps of 0.1 degC.

    The range spans every fitted dwell, so that none of them is clamped by the firmware, but ends
    at most `EDGE_DEGC` from the outer groups' temperatures. One temperature alone is +-`EDGE_DEGC`.
    """
    low, high = groups[0].temp_degc, groups[-1].temp_degc
    if unit.range_degc is None:
        if len(groups) == 1:
            return low - EDGE_DEGC, high + EDGE_DEGC
        coldest = max(low - EDGE_DEGC, min(d.temp_degc for d in groups[0].measured))
        hottest = min(high + EDGE_DEGC, max(d.temp_degc for d in groups[-1].measured))
        # The 1e-6 forgives the rounding of decimal temperatures: 0.3 / 0.1 is 2.9999999999999996.
        steps = math.floor(coldest / _STEP_DEGC + 1e-6), math.ceil(hottest / _STEP_DEGC - 1e-6)
        return round(steps[0] * _STEP_DEGC, 1), round(steps[1] * _STEP_DEGC, 1)
    if unit.range_degc[0] < low - EDGE_DEGC or unit.range_degc[1] > high + EDGE_DEGC:
        raise RefusedError(
            f"{unit.source}, [thermal] range_degc",
            f"{unit.range_degc[0]:g} to {unit.range_degc[1]:g} degC",
            expected=f"within {EDGE_DEGC:g} degC of the calibrated temperatures, "
            f"{low:.6g} to {high:.6g} degC",
            remedy="narrow the range, or measure further out: curves are not extrapolated",
        )
    return unit.range_degc
