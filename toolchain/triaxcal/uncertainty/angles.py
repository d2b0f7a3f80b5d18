"""Uncertainty of the angles of the device over the sphere, and what they are sensitive to.

With D of P0 (8), the derivatives of an angle by the acceleration, its error is D times the error
of the compensated acceleration at 1 g. The sources of that are those of all budgets, with their
correlations between the axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.orientation import AIRCRAFT, angle_slopes_of_force, gravity_direction
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import Uncertainty
from triaxcal.uncertainty.orientation import affine_of
from triaxcal.unit.angles import AnglesChoice

_STEP_DEG = 5.0
_NEAREST_DEG = 1.0
"""To the plumb line, of the axis of the second angle: at 0 it does not exist."""
_ARCSEC = np.degrees(1.0) * 3600.0


@dataclass(frozen=True)
class AngleUncertainty:
    """Over the first angle, the worst of every second angle; n first angles.

    Attributes
    ----------
    names : tuple of two str
    first_deg : array, shape (n,)
    at_t0, over_range : arrays, shape (n, 2)
        Expanded uncertainty (95 %) in arcsec: of the first angle, and of the second times the sine
        of the angle between its axis and the plumb line. At T0, and at the worst temperature.
    per_offset, per_scale : arrays, shape (n, 2, 3)
        Arcsec of the same for 1 mg of bias of an axis, and for 1e-3 of its scale.
    """

    names: tuple[str, str]
    first_deg: FloatArray
    at_t0: FloatArray
    over_range: FloatArray
    per_offset: FloatArray
    per_scale: FloatArray


def angle_uncertainty(u: Uncertainty, choice: AnglesChoice) -> AngleUncertainty:
    """Evaluate both angles on a grid of the sphere, at every temperature of `u`."""
    low, high = (-90.0, 90.0) if choice.kind == AIRCRAFT else (0.0, 180.0)
    first = np.arange(low, high + 1.0, _STEP_DEG).clip(low + _NEAREST_DEG, high - _NEAREST_DEG)
    second = np.arange(0.0, 360.0, _STEP_DEG)
    grid = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
    force = gravity_direction(choice.kind, np.radians(grid))
    slopes = angle_slopes_of_force(choice.kind, force)
    across = np.hypot(force[:, 1], force[:, 2 if choice.kind == AIRCRAFT else 0])
    slopes[:, 1] *= across[:, None]
    slopes *= _ARCSEC
    shape = len(first), len(second), 2

    def weights_of(columns: int) -> FloatArray:
        rows = affine_of(force, columns)
        W = slopes[:, :, :, None] * rows[:, None, None, :]
        return W.reshape(-1, 3 * columns)

    # (temperatures, first, 2), the worst of the second angle.
    worst = u.force_sums_u(weights_of).reshape(-1, *shape).max(axis=2)
    per_mg = np.abs(slopes) * 1e-3
    per_scale = per_mg * np.abs(force)[:, None, :]
    return AngleUncertainty(
        choice.names,
        first,
        worst[u.t0_index],
        worst.max(axis=0),
        per_mg.reshape(*shape, 3).max(axis=1),
        per_scale.reshape(*shape, 3).max(axis=1),
    )
