"""The tilter's positions and the specific force in each.

Source: M. G. Cherniak, Yu. Yu. Yuriev, the tilter paper (P1), figure 2 and equations (9), (10).
Axis order is x, y, z everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from triaxcal.model.types import FloatArray

TEST_POSITIONS: Mapping[str, tuple[int, int, int]] = MappingProxyType(
    {
        "TP1": (0, 0, 1),
        "TP2": (0, -1, 0),
        "TP3": (0, 0, -1),
        "TP4": (0, 1, 0),
        "TP5": (-1, 0, 0),
        "TP6": (1, 0, 0),
    }
)
"""Unit vector of specific force on the unit's axes in each test position, P1 (9)."""

CHECK_POSITIONS: tuple[str, ...] = ("CP1", "CP2", "CP3", "CP4", "CP5", "CP6")
"""Check positions, P1 figure 3: tilted by about 25 deg, known only to see |a| = g, never fitted."""

AXES = ("x", "y", "z")


def specific_force_g(position: str, gravity_g: float) -> FloatArray:
    """Specific force in a test position, shape (3,), in g of 9.80665 m/s^2.

    `gravity_g` is the local gravity in the same unit.
    """
    return np.array(TEST_POSITIONS[position], dtype=np.float64) * gravity_g


def position_of(face: str) -> str:
    """Test position in which an axis, as "+x", points up."""
    axis = AXES.index(face[1])
    sign = 1 if face[0] == "+" else -1
    return next(name for name, force in TEST_POSITIONS.items() if force[axis] == sign)
