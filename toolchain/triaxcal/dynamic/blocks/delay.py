"""Delay tau of the accelerometers behind the gyros, P2 (14).

A sample stamped t shows the force of t - tau. Gravity turns in the instrument as f' = -w x f, w
against the Earth, so f(t - tau) = exp(tau [w]) f(t): to first order the error is tau w x f. With
P2's hat(w) = -[w] the term of y is therefore -L'^T hat(w) f tau; the sign in print is lost.
What is felt besides gravity, by the lever arms, is late as well: less tau times its change.
At one constant rate tau cannot be separated from a turn of the gyros' axes.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.attitude import rotation_of
from triaxcal.dynamic.blocks.block import Signals, State, StateBlock, extension
from triaxcal.model.types import FloatArray


def rows(signals: Signals) -> FloatArray:
    """First order: w x f, and what else is felt."""
    first: FloatArray = np.cross(signals.turn, signals.force)[:, :, None]
    return first if signals.jerk is None else first - signals.jerk[:, :, None]


def curve(signals: Signals, p: FloatArray) -> FloatArray:
    """Exact for a rate that changes evenly over tau."""
    angle = signals.turn * p[0]
    if signals.acceleration is not None:
        angle = angle - signals.acceleration * (p[0] ** 2 / 2)
    turned = rotation_of(angle)
    later: FloatArray = np.einsum("nij,nj->ni", turned, signals.force) - signals.force
    if signals.jerk is not None:
        later = later - signals.jerk * p[0]
    return later


BLOCK = StateBlock(
    "delay",
    "delay of the accelerometers behind the gyros",
    (State("tau", "ms", 1e-3, 20.0, "delay of the accelerometers"),),
    motion=rows,
    motion_curve=curve,
)
ENTRY = extension(BLOCK, "The accelerometers' samples are later than the gyros'.")
