"""Nonlinearity of the accelerometers: df_i = q_i f_i^2 / g + c_i f_i^3 / g^2.

K2 and K3 of IEEE Std 1293, along each accelerometer's own axis.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import MM_PER_S2
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, diagonal, extension
from triaxcal.model.types import FloatArray

PER_G2, PER_G3 = "mm/s^2/g^2", "mm/s^2/g^3"


def _rows(signals: Signals) -> FloatArray:
    return np.concatenate([diagonal(signals.load**2), diagonal(signals.load**3)], axis=2)


BLOCK = StateBlock(
    "accelerometer-nonlinearity",
    "nonlinearity of the accelerometers",
    tuple(
        State(f"{name}{i}", unit, MM_PER_S2, 50.0, f"{label}, accelerometer {AXIS[i]}")
        for name, unit, label in (
            ("qf", PER_G2, "square of the force"),
            ("cf", PER_G3, "cube of the force"),
        )
        for i in (1, 2, 3)
    ),
    force=_rows,
)
ENTRY = extension(BLOCK, "The accelerometers' scale factors change with the force.")
