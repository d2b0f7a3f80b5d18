"""Gyro drift that depends on specific force, P2 (13): nu = ... + D f / g."""

from __future__ import annotations

from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension, spread
from triaxcal.model.types import FloatArray


def _rows(signals: Signals) -> FloatArray:
    return spread(signals.load)


BLOCK = StateBlock(
    "g-drift",
    "g-dependent gyro drift",
    tuple(
        State(f"D{i}{j}", "deg/h/g", DEG_PER_H, 3600.0, f"gyro {AXIS[i]}, force along {AXIS[j]}")
        for i in (1, 2, 3)
        for j in (1, 2, 3)
    ),
    rate=_rows,
    weak=(
        "with the force along gravity it is a rate about the vertical, which only a heading shows; "
        "along a force of 1 g the gyros' rates are uncertain by as much. Recording the table's "
        'angle separates it (block "table-angles")'
    ),
)
ENTRY = extension(BLOCK, "Gyro drift in proportion to the specific force.")
