"""Lever arm of the instrument's point M, P2 (16): s is the table's centre in instrument axes.

M moves at V = w x (-s) = hat(w) s, in the instrument's axes, w against the Earth. Seen from the
Earth the force it feels besides gravity is dV/dt + 2 u x V. The mean of the first over a block is
the difference of V between its ends: no angular acceleration is needed, which P2 had to find
by differentiating the gyros. Point by point it is (hat(w')  - hat(w)^2) s, w' the angular
acceleration; the signs in print are damaged.
"""

from __future__ import annotations

from triaxcal.dynamic.blocks.attitude import skew
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension
from triaxcal.model.types import FloatArray


def _velocity(signals: Signals) -> FloatArray:
    return -skew(signals.turn)


def _coriolis(signals: Signals) -> FloatArray:
    coriolis: FloatArray = -2 * skew(signals.rate - signals.turn) @ skew(signals.turn)
    return coriolis


BLOCK = StateBlock(
    "lever-arm",
    "lever arm of the table's centre",
    tuple(State(f"s{i}", "mm", 1e-3, 1000.0, f"table's centre along {AXIS[i]}") for i in (1, 2, 3)),
    motion=_coriolis,
    edges=_velocity,
    motion2=_coriolis,
    edges2=_velocity,
    reset=True,
)
ENTRY = extension(BLOCK, "The unit is not in the table's centre.")
