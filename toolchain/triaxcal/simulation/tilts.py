"""Directions of the simulated unit's check positions.

The tilter's check positions lean about 25 deg from the axes (P1, figure 3); the figure is not in
numbers, so the azimuths here are our own. CPk leans `TILT_DEG` from the direction of TPk. Its
azimuth is 15 + 60 (k - 1) deg, counted from the next axis in the order x, y, z, x towards the one
after it: six azimuths a sixth of a turn apart, none of them along an axis.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS, specific_force_g
from triaxcal.model.types import FloatArray

TILT_DEG = 25.0
_FIRST_AZIMUTH_DEG = 15.0
_AZIMUTH_STEP_DEG = 60.0


def truth_force_g(position: str, gravity_g: float) -> FloatArray:
    """Specific force in a test or check position of the simulator, shape (3,), in g.

    Axis order x, y, z; `gravity_g` is the local gravity in g of 9.80665 m/s^2.
    """
    if position in TEST_POSITIONS:
        return specific_force_g(position, gravity_g)
    k = CHECK_POSITIONS.index(position)
    axis_vector = np.array(TEST_POSITIONS[f"TP{k + 1}"], dtype=np.float64)
    axis = int(np.argmax(np.abs(axis_vector)))
    tilt = math.radians(TILT_DEG)
    azimuth = math.radians(_FIRST_AZIMUTH_DEG + k * _AZIMUTH_STEP_DEG)
    direction = math.cos(tilt) * axis_vector
    direction[(axis + 1) % 3] = math.sin(tilt) * math.cos(azimuth)
    direction[(axis + 2) % 3] = math.sin(tilt) * math.sin(azimuth)
    return gravity_g * direction
