"""Which position of the tilter is it? By the nominal scale, before anything is calibrated."""

from __future__ import annotations

import numpy as np

from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.types import FloatArray

AXIS_MIN_G = 0.8
TEST_ASIDE_MAX_G = 0.3
CHECK_ASIDE_MAX_G = 0.6
"""Force along the axis at least; force across it in a test and in a check position at most.

A check position leans 25 deg: cos 25 = 0.91, sin 25 = 0.42.
"""

UP = {"TP1": "+Z", "TP2": "-Y", "TP3": "-Z", "TP4": "+Y", "TP5": "-X", "TP6": "+X"}
"""Axis that points up."""


def recognised(mean_code: FloatArray, micro_g_per_code: FloatArray) -> str | None:
    """Position of mean codes (3,), or None: between positions, or falling."""
    force_g = mean_code * micro_g_per_code * 1e-6
    axis = int(np.argmax(np.abs(force_g)))
    aside_g = float(np.sqrt(max(0.0, float(force_g @ force_g - force_g[axis] ** 2))))
    if abs(force_g[axis]) <= AXIS_MIN_G or aside_g > CHECK_ASIDE_MAX_G:
        return None
    unit = [0, 0, 0]
    unit[axis] = 1 if force_g[axis] > 0 else -1
    test = next(name for name, direction in TEST_POSITIONS.items() if list(direction) == unit)
    return test if aside_g < TEST_ASIDE_MAX_G else "C" + test[1:]


def described(position: str) -> str:
    """Position with the axis that points up, for readers."""
    if position in CHECK_POSITIONS:
        return f"{position} ({UP['T' + position[1:]]} up, tilted)"
    return f"{position} ({UP[position]} up)"
