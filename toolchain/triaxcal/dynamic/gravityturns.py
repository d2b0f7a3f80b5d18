"""How gravity turns in the unit from window to window, and what the gyros measure of it.

With the direction f of the force and the rate w, f1 - f0 = [f] M w dt, where M is the identity for
gyros and accelerometers of the same axes, signs and units.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from triaxcal.dynamic.blocks.attitude import skew
from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import BoolArray, FloatArray

NEAR_GRAVITY = 0.1
"""Of the usual size of the force."""
SIGNED_AXES = tuple(product(permutations(range(3)), product((1.0, -1.0), repeat=3)))
"""Axis that stands for each of x, y, z, and its sign: as stated first."""


@dataclass(frozen=True)
class GravityTurns:
    """From each of w windows to the next one.

    Attributes
    ----------
    follows : array, shape (w - 1,)
        Whether the two are in one section.
    alone : array, shape (w - 1,)
        And whether only gravity turns: both forces have its size. A hand that throws the unit about
        turns the force by more than gravity does.
    turn : array, shape (w - 1, 3)
        By the gyros less their bias, rad.
    middle : array, shape (w - 1, 3, 3)
        [f] of the direction in between.
    change : array, shape (w - 1, 3)
        Of the direction.
    """

    follows: BoolArray
    alone: BoolArray
    turn: FloatArray
    middle: FloatArray
    change: FloatArray


def gravity_turns(windows: Windows, bias: FloatArray) -> GravityTurns:
    """Turns between windows; `bias`, shape (3,), is that of the gyros, rad/s."""
    size = np.linalg.norm(windows.force, axis=1)
    near = np.abs(size / np.median(size) - 1) < NEAR_GRAVITY
    follows = (np.diff(windows.first) > 0) & (np.diff(windows.section) == 0)
    force, rate = windows.force / size[:, None], windows.rate - bias
    return GravityTurns(
        follows,
        follows & near[1:] & near[:-1],
        (rate[:-1] + rate[1:]) / 2 * np.diff(windows.start_s)[:, None],
        skew((force[1:] + force[:-1]) / 2),
        force[1:] - force[:-1],
    )


def signed_axes_matrices() -> FloatArray:
    """M of each of `SIGNED_AXES`, shape (48, 3, 3)."""
    return np.array([np.diag(signs) @ np.eye(3)[list(order)] for order, signs in SIGNED_AXES])
