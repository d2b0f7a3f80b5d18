"""A table whose two axes are not at right angles: known, or estimated with the triad.

With e between the two axes of the angles, the force turns by e about the third direction:

    aircraft       dg = e sin(pitch) (0, cos(roll), -sin(roll))
    inclinometer   dg = e cos(zenith) (-sin(tool face), cos(tool face), 0)

In P0's angles that is -e g_x g_z / cos(pitch) in y and e g_x g_y / cos(pitch) in z: it looks like
two products of one size, 4 arcsec like 2e-5 g/g^2. What tells them apart is that both have the same
e, and the cosine. Linear constants do not take it up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.table.oriented import inverse_linear
from triaxcal.model.orientation import AIRCRAFT
from triaxcal.model.types import FloatArray

ROUNDS = 4


@dataclass(frozen=True)
class StandAxes:
    """How far the axes of a table are from a right angle, rad, and its standard deviation."""

    value_rad: float
    sd_rad: float


def stand_direction(kind: str, angles_rad: FloatArray, orthogonality_rad: float) -> FloatArray:
    """g / |g| on the unit's axes, (n, 3), on a table whose axes are off a right angle."""
    first, second = angles_rad[..., 0], angles_rad[..., 1]
    s, c = np.sin(orthogonality_rad), np.cos(orthogonality_rad)
    if kind == AIRCRAFT:
        x, y, z = -np.sin(first) * c, np.sin(first) * s, np.cos(first)
        turned = (
            x,
            y * np.cos(second) + z * np.sin(second),
            z * np.cos(second) - y * np.sin(second),
        )
    else:
        x, y, z = -np.sin(first), np.cos(first) * s, np.cos(first) * c
        turned = (
            x * np.cos(second) - y * np.sin(second),
            x * np.sin(second) + y * np.cos(second),
            z,
        )
    return np.stack(turned, axis=-1)


def stand_axes(
    kind: str, angles_rad: FloatArray, readings: FloatArray, gravity_g: float
) -> StandAxes:
    """The angle with the twelve linear constants, from readings (n, 3).

    The column of e is freed of what the constants explain (Frisch and Waugh), so the other unknowns
    need not be solved for again. Outputs are weighted alike, in g.
    """
    value, sd = 0.0, np.inf
    for _ in range(ROUNDS):
        force = gravity_g * stand_direction(kind, angles_rad, value)
        residual = force - inverse_linear(readings, force).force_g(readings)
        slope = gravity_g * _slope(kind, angles_rad)
        design = np.concatenate([np.ones((len(force), 1)), readings - readings.mean(axis=0)], 1)
        basis = np.linalg.qr(design)[0]
        own = slope - basis @ (basis.T @ slope)
        information = float((own**2).sum())
        dof = 3 * len(force) - 12 - 1
        change = -float((own * residual).sum()) / information
        left = residual + own * change
        sd = float(np.sqrt((left**2).sum() / dof / information))
        value += change
    return StandAxes(value, sd)


def _slope(kind: str, angles_rad: FloatArray) -> FloatArray:
    step = 1e-4
    plus, minus = (stand_direction(kind, angles_rad, sign * step) for sign in (1.0, -1.0))
    result: FloatArray = (plus - minus) / (2.0 * step)
    return result
